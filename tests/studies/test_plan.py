"""Running a study: parts in order, nothing lost, and what is wrong said."""

import json
import sys

import numpy as np
import pytest

from poise.errors import ConfigurationError, MissingExtraError
from studies.finding import Finding, Section, Table, draw, number_text
from studies.page import write_study
from studies.plan import Part, StudyOptions, StudyPlan

pytest.importorskip("matplotlib")


def finding(name="a number", *, ok=True, **changes):
    values = {"paper": 2, "ours": 2.5, "unit": "m", "note": "a <b> & note"} | changes
    return Finding(name=name, ok=ok, **values)


def paint(canvas):
    canvas.subplots().plot([0.0, 1.0], [0.0, 1.0])


def good(options, progress):
    progress(1.0, 2.0)
    return Section(
        prose=("Some `code` & <words>, n = 3.",),
        findings=(finding(),),
        figures=(draw(name="line", title="A line", caption="It rises.", height=2.0, paint=paint),),
        tables=(Table(title="T", header="what | x [m]", rows=(("a", 1), ("b", None))),),
    )


def seeded(options, progress):
    value = float(np.random.default_rng(options.seed).random())
    return Section(findings=(finding("random", paper=None, ours=value),))


def broken(options, progress):
    return np.linalg.inv(np.zeros((2, 2)))


def refused(options, progress):
    raise ConfigurationError("no such gain", got=-1.0)


def plan(**parts):
    return StudyPlan(
        name="trial",
        title="A <trial>",
        introduction=("What it is.",),
        source="Somebody, “Something”, 2022.",
        parts=tuple(Part(name=n, title=f"Part {n}", compute=c) for n, c in parts.items()),
    )


def test_what_is_computed_is_written_before_the_next_part_begins(tmp_path):
    seen = []

    def look(options, progress):
        seen.append(json.loads((tmp_path / "study.json").read_text()))
        page = (tmp_path / "study.html").read_text()
        assert "Part two</strong>: not computed" in page
        assert (tmp_path / "line.svg").is_file()
        return Section()

    study = plan(one=good, two=look).run(
        StudyOptions(), save=lambda so_far: write_study(so_far, tmp_path)
    )
    assert study.ok
    assert [row["ok"] for row in seen[0]] == [True, False]
    assert seen[0][1]["note"] == "Part two: not computed"


@pytest.mark.parametrize(
    ("part", "reason"), [(broken, "LinAlgError: Singular"), (refused, "no such gain; got -1.0")]
)
def test_a_part_that_fails_takes_nothing_along_and_is_named(tmp_path, part, reason):
    study = plan(one=good, two=part, three=seeded).run(
        StudyOptions(), save=lambda so_far: write_study(so_far, tmp_path)
    )
    assert not study.ok
    assert [s.name for s in study.sections] == ["one", "three"]
    rows = json.loads((tmp_path / "study.json").read_text())
    assert [row["name"] for row in rows] == ["a number", "random", "part 'two' of the study"]
    assert rows[-1]["ok"] is False
    assert reason in rows[-1]["note"]
    page = (tmp_path / "study.html").read_text()
    assert "1 part has no result" in page
    assert ("traceback" in page) == (part is broken)


def test_the_page_says_in_words_what_holds_and_refers_to_nothing_outside(tmp_path):
    def mixed(options, progress):
        return Section(findings=(finding("first"), finding("second", ok=False)))

    page = write_study(plan(one=good, two=mixed).run(StudyOptions()), tmp_path).read_text()
    assert "✗ 1 of 3 findings failed" in page
    assert "✓ holds" in page
    assert "✗ failed" in page
    assert "Findings that failed" in page
    assert "A &lt;trial&gt;" in page
    assert "a &lt;b&gt; &amp; note" in page
    assert "<code>code</code> &amp; &lt;words&gt;" in page
    assert "<svg" in page
    for outside in ("http://", "https://", "<script", "src="):
        assert outside not in page.replace("http://www.w3.org", "")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (46_398, "46,398"),
        (154_936.67, "154,937"),
        (-3, "−3"),
        (2.5992, "2.6"),
        (0.00004, "4e−05"),
        (7, "7"),
        (float("nan"), "–"),
    ],
)
def test_numbers_read_well(value, text):
    assert number_text(value) == text


def test_without_matplotlib_nothing_is_computed(monkeypatch):
    def computed(options, progress):
        pytest.fail("computed")

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"poise\[sim\]"):
        plan(one=computed).run(StudyOptions())
