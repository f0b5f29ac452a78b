"""The cost model gives the paper's numbers, and its formulas agree with each other."""

from fractions import Fraction

import pytest

from poise.errors import ConfigurationError
from studies.bias_acceleration import cost_model as cost
from studies.bias_acceleration.cost_model import QUOTED, SWEEPS
from studies.bias_acceleration.cost_section import cost_findings

FORMULAS = (
    cost.osf_without_bias, cost.bias_original, cost.osf_original, cost.osf_original_as_printed,
    cost.bias_proposed, cost.osf_proposed,
)  # fmt: skip
SIZES = [(n, k, m) for n in (1, 2, 6, 17, 30, 50) for k in (1, 2, 3, 10) for m in (1, 2, 3, 6, 15)]

# n, k, m; bias and total with the original formula, bias with the proposed one; section III.F.
QUOTES = [
    ((50, 2, 3), 46_398, 154_937, 1_206),
    ((30, 10, 3), 153_522, 327_642, 6_534),
    ((30, 2, 15), 92_760, 259_860, 3_630),
]


@pytest.mark.parametrize(("size", "bias", "total", "proposed"), QUOTES)
def test_quoted_numbers_come_out_exactly(size, bias, total, proposed):
    assert cost.bias_original(*size) == bias
    assert cost.bias_proposed(*size) == proposed
    # The paper rounds its thirds.
    assert abs(cost.osf_original(*size) - total) <= Fraction(1, 3)


def test_figure_2_comes_out_exactly():
    parts = [cost.row_cost(row.original, 30, 4, 3) for row in cost.TABLE_1]
    assert parts[0] + parts[1] + parts[3] == 33_534
    assert parts[4] == 16_461
    assert round(100 * 33_534 / cost.bias_original(30, 4, 3), 1) == Fraction("65.5")
    assert round(100 * 16_461 / cost.bias_original(30, 4, 3), 1) == Fraction("32.2")


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_columns_of_table_1_add_up_to_the_formulas(size):
    rows = cost.TABLE_1
    assert sum(cost.row_cost(r.original, *size) for r in rows) == cost.bias_original(*size)
    assert sum(cost.row_cost(r.proposed, *size) for r in rows) == cost.bias_proposed(*size)


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_totals_are_sums_and_the_printed_44_is_not(size):
    n, _, m = size
    rest = cost.osf_without_bias(*size)
    assert cost.osf_original(*size) == rest + cost.bias_original(*size)
    assert cost.osf_proposed(*size) == rest + cost.bias_proposed(*size)
    assert cost.osf_original_as_printed(*size) - cost.osf_original(*size) == 10 * m * n


def test_one_task_has_no_bias_acceleration():
    assert cost.bias_original(30, 1, 3) == cost.bias_proposed(30, 1, 3) == 0


@pytest.mark.parametrize("formula", FORMULAS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("size", [(0, 2, 3), (30, -1, 3), (30, 2, 0), (True, 2, 3)], ids=str)
def test_sizes_that_are_none_are_refused(formula, size):
    with pytest.raises(ConfigurationError, match="wanted a whole number >= 1"):
        formula(*size)


def test_sweeps_end_at_the_quoted_sizes():
    assert [sizes[-1] for sizes in SWEEPS.values()] == [case.size for case in QUOTED]


def test_every_quoted_number_is_a_finding_that_holds():
    findings = {f.name: f for f in cost_findings()}
    assert len(findings) == len(cost_findings())
    quoted = {f.paper for f in findings.values()}
    assert {46_398, 154_937, 1_206, 153_522, 327_642, 6_534} <= quoted
    assert {92_760, 259_860, 3_630, 33_534, 16_461} <= quoted
    assert {29.9, 46.9, 35.7, 65.5, 32.2, 2.6, 4.3, 3.9, 29.2, 44.9, 34.3} <= quoted
    assert [f.name for f in findings.values() if not f.ok] == []


def test_the_misprint_is_told_with_the_numbers_both_ways():
    misprint = next(
        f for f in cost_findings() if f.name == "(44) corrected (n = 30, k = 2, m = 15)"
    )
    assert misprint.paper == misprint.ours == 259_860
    for words in ("(11k − 5) m", "(11k + 5) m", "264,360", "4,500"):
        assert words in misprint.note


def test_a_wrong_model_would_fail_its_findings(monkeypatch):
    right = cost.bias_original
    monkeypatch.setattr(cost, "bias_original", lambda n, k, m: right(n, k, m) + 1)
    failed = [f.name for f in cost_findings() if not f.ok]
    assert "original bias acceleration (n = 50, k = 2, m = 3)" in failed
    assert "original column of Table 1 and (43) (n = 30, k = 4, m = 3)" in failed
    assert any(name.startswith("(44) corrected") for name in failed)
