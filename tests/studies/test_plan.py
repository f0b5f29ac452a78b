"""Running a study: parts in order, nothing lost, and what is wrong said."""

import json
import subprocess
import sys

import numpy as np
import pytest

from poise.errors import ConfigurationError, MissingExtraError, UnknownNameError
from studies.finding import Figure, Finding, Section, Table, draw, number_text, with_unit
from studies.page import write_study
from studies.plan import STUDIES, Part, StudyOptions, StudyPlan, load_study

pytest.importorskip("matplotlib")

KEYS = ["name", "paper", "ours", "unit", "ok", "note"]


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


def test_findings_stand_in_the_order_of_the_parts():
    study = plan(one=good, two=seeded).run(StudyOptions(seed=3))
    assert [f.name for f in study.findings] == ["a number", "random"]
    assert [(s.name, s.title) for s in study.sections] == [("one", "Part one"), ("two", "Part two")]
    assert study.ok
    assert (study.options.seed, study.options.quick) == (3, False)


def test_the_seed_decides_everything_random():
    run = plan(two=seeded).run
    assert run(StudyOptions(seed=3)) == run(StudyOptions(seed=3))
    assert run(StudyOptions(seed=3)) != run(StudyOptions(seed=4))


def test_one_finding_that_fails_fails_the_study():
    study = plan(one=lambda *_: Section(findings=(finding(ok=False), finding("b")))).run(
        StudyOptions()
    )
    assert not study.ok


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


def test_an_interruption_leaves_the_parts_that_are_done(tmp_path):
    def interrupted(options, progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan(one=good, two=interrupted).run(
            StudyOptions(), save=lambda so_far: write_study(so_far, tmp_path)
        )
    rows = json.loads((tmp_path / "study.json").read_text())
    assert [row["ok"] for row in rows] == [True, False]


def test_each_part_has_a_progress_of_its_own():
    shown = []

    class Bar:
        def __init__(self, title):
            self.title = title

        def __enter__(self):
            return lambda done, total: shown.append((self.title, done, total))

        def __exit__(self, *_):
            shown.append((self.title, "closed"))

    plan(one=good, two=seeded).run(StudyOptions(), show=Bar)
    assert shown == [("Part one", 1.0, 2.0), ("Part one", "closed"), ("Part two", "closed")]


def test_the_same_study_gives_the_same_bytes(tmp_path):
    for folder in ("a", "b"):
        write_study(plan(one=good).run(StudyOptions()), tmp_path / folder)
    for name in ("study.json", "study.html", "line.svg"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert {p.name for p in (tmp_path / "a").iterdir()} == {"study.json", "study.html", "line.svg"}


def test_json_has_the_six_keys_and_no_number_that_json_does_not_know(tmp_path):
    odd = finding("odd", ok=False, paper=float("nan"), ours=float("inf"))
    write_study(plan(one=lambda *_: Section(findings=(odd,))).run(StudyOptions()), tmp_path)
    rows = json.loads((tmp_path / "study.json").read_text(), parse_constant=pytest.fail)
    assert list(rows[0]) == KEYS
    assert rows[0]["paper"] is rows[0]["ours"] is None


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


def test_a_figures_file_stands_alone(tmp_path):
    from xml.etree import ElementTree

    write_study(plan(one=good).run(StudyOptions()), tmp_path)
    root = ElementTree.parse(tmp_path / "line.svg").getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert root.get("width") == "864pt"
    assert "var(--font)" not in (tmp_path / "line.svg").read_text()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (46_398, "46,398"),
        (154_936.67, "154,937"),
        (-3, "−3"),
        (2.5992, "2.6"),
        (0.0008, "8e−4"),
        (7, "7"),
        (float("nan"), "–"),
    ],
)
def test_numbers_read_well(value, text):
    assert number_text(value) == text


def test_a_unit_stands_behind_a_number_that_is_there():
    assert with_unit(3, "FLOP") == "3 FLOP"
    assert with_unit(3, "") == "3"
    assert with_unit(None, "FLOP") == "–"


BAD = {
    "a finding without a name": lambda: finding(" "),
    "a finding that holds without a number": lambda: finding(ours=None),
    "a finding that holds with no number": lambda: finding(ours=float("nan")),
    "a row that does not fit": lambda: Table(title="T", header="a | b", rows=((1,),)),
    "a figure that is no file": lambda: Figure(name="../x", title="", caption="", svg=""),
    "a negative seed": lambda: StudyOptions(seed=-1),
    "no seed": lambda: StudyOptions(seeds=0),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_right_is_refused(case):
    with pytest.raises(ConfigurationError, match="got"):
        BAD[case]()


def test_an_unknown_study_is_told_the_choices():
    with pytest.raises(UnknownNameError, match=r"got 'bias'; choices: bias-acceleration"):
        load_study("bias")


def test_without_matplotlib_nothing_is_computed(monkeypatch):
    def computed(options, progress):
        pytest.fail("computed")

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"poise\[sim\]"):
        plan(one=computed).run(StudyOptions())


def test_importing_studies_imports_neither_matplotlib_nor_a_study():
    script = (
        "import sys, studies; "
        "print([m for m in sys.modules if m in ('matplotlib', 'mujoco') "
        "or m.startswith('studies.bias')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_has_a_plan_with_parts_of_different_names(name):
    made = load_study(name)
    assert made.name == name
    names = [part.name for part in made.parts]
    assert len(set(names)) == len(names) > 0
