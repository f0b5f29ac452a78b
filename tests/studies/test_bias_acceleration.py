"""The study of the bias acceleration: its parts in their quick version."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from poise._progress import Bar
from studies.bias_acceleration.cost_section import cost_section
from studies.page import write_study
from studies.plan import STUDIES, StudyOptions, load_study

pytest.importorskip("matplotlib")

DOCS = Path(__file__).parents[2] / "docs" / "studies.md"


@pytest.fixture(scope="module")
def cost():
    seen = []
    section = cost_section(StudyOptions(quick=True), lambda done, total: seen.append((done, total)))
    assert seen[-1] == (1.0, 1.0)
    return section


def test_figures_1_and_3_are_drawn_with_units_and_the_quoted_numbers(cost):
    figures = {figure.name: figure.svg for figure in cost.figures}
    assert list(figures) == ["figure-1", "figure-3"]
    for svg in figures.values():
        assert "[FLOP]" in svg
    for numbers, name in (
        (("154,937", "46,398", "327,642", "153,522", "259,860", "92,760"), "figure-1"),
        (("46,398", "1,206", "153,522", "6,534", "92,760", "3,630"), "figure-3"),
    ):
        assert [n for n in numbers if n not in figures[name]] == []


def test_table_1_adds_up_on_the_page(cost):
    table = cost.tables[0]
    for column in (1, 2):
        cells = [row[column] or 0 for row in table.rows]
        assert sum(cells[:-1]) == cells[-1]
    assert table.rows[-1][1:3] == (51_174, 2_178)


def test_findings_have_different_names(cost):
    names = [f.name for f in cost.findings]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", STUDIES)
def test_the_documentation_names_every_study_its_files_and_keys(name):
    text = DOCS.read_text(encoding="utf-8")
    words = [name, "study.json", "study.html", "name", "paper", "ours", "unit", "ok", "note"]
    assert [
        w for w in words if not re.search(rf"`(?:[^`]*\W)?{re.escape(w)}(?:\W[^`]*)?`", text)
    ] == []


def test_numbers_in_json_are_whole_where_counts_are(cost):
    rows = [finding.to_json() for finding in cost.findings]
    assert json.loads(json.dumps(rows)) == rows
    by_name = {row["name"]: row for row in rows}
    assert by_name["proposed bias acceleration (n = 30, k = 10, m = 3)"]["ours"] == 6_534
    assert isinstance(by_name["proposed bias acceleration (n = 30, k = 10, m = 3)"]["ours"], int)


def test_the_cost_model_runs_as_a_part_of_the_study(tmp_path):
    plan = load_study("bias-acceleration")
    first = replace(plan, parts=plan.parts[:1])
    study = first.run(StudyOptions(quick=True), show=lambda title: Bar(title, ""))
    assert [part.reason for part in study.unfinished] == []
    assert study.ok
    page = write_study(study, tmp_path).read_text()
    assert "✓ All" in page
    assert {p.name for p in tmp_path.iterdir()} == {
        "study.html", "study.json", "figure-1.svg", "figure-3.svg",
    }  # fmt: skip
