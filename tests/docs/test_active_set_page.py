"""The page of the lexicographic solver says what its constants are."""

import ast
import re
from pathlib import Path

from poise.hqp import SolveStatus
from poise.hqp.lexls import solver, tolerances

PAGE = Path(__file__).parents[2] / "docs" / "lexls.md"
ROW = re.compile(r"^\| `([A-Z_]+)` \| ([^|]*) \| ([^|]*) \|$", re.MULTILINE)


def test_every_tolerance_stands_in_the_table_with_its_value():
    wanted = {name: value for name, value in vars(tolerances).items() if name.isupper()}
    wanted["RELAXED"] = solver.RELAXED
    text = PAGE.read_text(encoding="utf-8").partition("\n## Tolerances")[2].partition("\n## ")[0]
    assert {name: ast.literal_eval(value) for name, value, _ in ROW.findall(text)} == wanted


def test_the_cap_on_changes_is_the_one_it_states():
    assert "`50 + 10 (n + m)`" in PAGE.read_text(encoding="utf-8")
    assert tolerances.changes_allowed(7, 11) == 50 + 10 * (7 + 11)


def test_every_status_is_explained():
    explained = {name for name, _, _ in ROW.findall(PAGE.read_text(encoding="utf-8"))}
    assert {status.name for status in SolveStatus} <= explained
