"""The pages of the hierarchical QP say what its constants are."""

import ast
import re
from pathlib import Path

from poise.hqp import SolveStatus, _tolerances

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "active_set.md"
ROW = re.compile(r"^\| `([A-Z_]+)` \| ([^|]*) \| ([^|]*) \|$", re.MULTILINE)


def table(page):
    """Names and values of a page's table of tolerances."""
    text = page.read_text(encoding="utf-8").partition("\n## Tolerances")[2].partition("\n## ")[0]
    return {name: ast.literal_eval(value) for name, value, _ in ROW.findall(text)}


def test_every_tolerance_stands_in_a_table_with_its_value():
    wanted = {name: value for name, value in vars(_tolerances).items() if name.isupper()}
    assert table(PAGE) | table(DOCS / "hqp.md") == wanted


def test_every_tolerance_stands_in_one_table_only():
    assert not table(PAGE).keys() & table(DOCS / "hqp.md").keys()


def test_the_cap_on_changes_is_the_one_it_states():
    assert "`50 + 10 (n + m)`" in PAGE.read_text(encoding="utf-8")
    assert _tolerances.changes_allowed(7, 11) == 50 + 10 * (7 + 11)


def test_every_status_is_explained():
    explained = {name for name, _, _ in ROW.findall(PAGE.read_text(encoding="utf-8"))}
    assert {status.name for status in SolveStatus} <= explained
