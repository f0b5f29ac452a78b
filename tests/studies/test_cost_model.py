"""The cost model gives the paper's numbers, and its formulas agree with each other."""

from fractions import Fraction

import pytest

from poise.errors import ConfigurationError
from studies.bias_acceleration import cost_model as cost
from studies.bias_acceleration.cost_section import cost_findings

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


def test_a_size_that_is_none_is_refused():
    with pytest.raises(ConfigurationError, match="wanted a whole number >= 1"):
        cost.bias_original(30, -1, 3)


def test_every_quoted_number_is_a_finding_that_holds():
    findings = {f.name: f for f in cost_findings()}
    assert len(findings) == len(cost_findings())
    quoted = {f.paper for f in findings.values()}
    assert {46_398, 154_937, 1_206, 153_522, 327_642, 6_534} <= quoted
    assert {92_760, 259_860, 3_630, 33_534, 16_461} <= quoted
    assert {29.9, 46.9, 35.7, 65.5, 32.2, 2.6, 4.3, 3.9, 29.2, 44.9, 34.3} <= quoted
    assert [f.name for f in findings.values() if not f.ok] == []
