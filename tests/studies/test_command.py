"""`python -m studies`: help, files, exit status, and one clean line for bad input."""

import json
from types import SimpleNamespace

import pytest

pytest.importorskip("matplotlib")

from studies import plan as plans
from studies.__main__ import main
from studies.finding import Finding, Section
from studies.plan import Part, StudyPlan

OK = Finding(name="of the paper", paper=3, ours=3, unit="m", ok=True, note="quoted")
BAD = Finding(name="of ours", paper=None, ours=1.5, unit="", ok=False)


def section(*findings):
    return lambda options, progress: Section(findings=findings)


def broken(options, progress):
    raise ZeroDivisionError("by zero")


@pytest.fixture
def trial(monkeypatch, tmp_path):
    """A study by the name `trial` with given parts, in a folder of its own."""

    def install(**parts):
        made = tuple(Part(name=n, title=f"Part {n}", compute=c) for n, c in parts.items())
        plan = StudyPlan(name="trial", title="T", introduction=(), source="S.", parts=made)
        monkeypatch.setitem(plans._MODULES, "trial", "trial")
        monkeypatch.setattr(plans, "import_module", lambda _: SimpleNamespace(PLAN=plan))

    monkeypatch.chdir(tmp_path)
    return install


def test_files_lie_beside_one_another_and_the_findings_are_printed(trial, tmp_path, capsys):
    trial(one=section(OK))
    assert main(["trial"]) == 0
    folder = tmp_path / "runs" / "study-trial"
    assert {p.name for p in folder.iterdir()} == {"study.html", "study.json"}
    out, err = capsys.readouterr()
    assert err == ""
    assert "trial: all 1 findings hold" in out
    assert "  ok    of the paper: 3 m (paper: 3 m)" in out
    assert "page: runs/study-trial/study.html" in out


def test_json_prints_one_finding_a_line_and_nothing_else(trial, tmp_path, capsys):
    trial(one=section(OK, BAD))
    assert main(["trial", "--json", "--out", "o"]) == 1
    out, err = capsys.readouterr()
    assert err == ""
    rows = [json.loads(line) for line in out.splitlines()]
    assert rows == json.loads((tmp_path / "o" / "study.json").read_text())
    assert list(rows[0]) == ["name", "paper", "ours", "unit", "ok", "note"]


def test_parts_that_are_named_are_the_study(trial, capsys):
    trial(one=section(OK), two=broken, three=section(OK))
    assert main(["trial", "--part", "three", "--part", "one"]) == 0
    assert "all 2 findings hold" in capsys.readouterr().out
    assert main(["trial", "--part", "four"]) == 2
    assert "got 'four'; choices: one, two, three" in capsys.readouterr().err


def test_seeds_are_as_many_as_asked_for(trial, capsys):
    def counted(options, progress):
        seeds = Finding(name="seeds", ours=options.count(20, 2), ok=True)
        return Section(findings=(seeds,))

    trial(one=counted)
    for arguments, seeds in ([], 20), (["--quick"], 2), (["--quick", "--seeds", "7"], 7):
        assert main(["trial", *arguments]) == 0
        assert f"seeds: {seeds}\n" in capsys.readouterr().out
    assert main(["trial", "--seeds", "0"]) == 2
    assert "got 0; wanted >= 1" in capsys.readouterr().err


def untouched(options, progress):
    pytest.fail("computed")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["bias"], ("'bias'", "choices: bias-acceleration")),
        ([""], ("''", "bias-acceleration")),
        (["trial", "--out", "taken"], ("'taken'", "writable")),
        (["trial", "--out", "taken/deeper"], ("taken/deeper", "writable")),
        (["trial", "--out", "full"], ("study.json",)),
    ],
    ids=str,
)
def test_bad_input_is_one_line_and_status_two_and_nothing_is_computed(
    trial, tmp_path, capsys, arguments, words
):
    trial(one=untouched)
    (tmp_path / "taken").write_text("")
    (tmp_path / "full" / "study.json").mkdir(parents=True)
    assert main([*arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("studies: ")
    assert err.count("\n") == 1
    assert all(word in err for word in words)
