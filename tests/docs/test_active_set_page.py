"""The pages of the hierarchical QP name constants and statuses as they are."""

import re
from pathlib import Path

import pytest

from poise.hqp import SolveStatus, _tolerances

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "active_set.md"
ROW = re.compile(r"^\| `([A-Z_]+)` \| ([^|]*) \| ([^|]*) \|$", re.MULTILINE)


@pytest.mark.parametrize("page", ["active_set.md", "hqp.md"])
def test_every_constant_that_a_page_names_exists(page):
    names = set(re.findall(r"`([A-Z]{2,}(?:_[A-Z]+)*)`", (DOCS / page).read_text(encoding="utf-8")))
    known = vars(_tolerances).keys() | {status.name for status in SolveStatus}
    assert names
    assert names <= known


def test_the_cap_on_changes_is_the_one_it_states():
    assert "`50 + 10 (n + m)`" in PAGE.read_text(encoding="utf-8")
    assert _tolerances.changes_allowed(7, 11) == 50 + 10 * (7 + 11)


def test_every_status_is_explained():
    explained = {name for name, _, _ in ROW.findall(PAGE.read_text(encoding="utf-8"))}
    assert {status.name for status in SolveStatus} <= explained
