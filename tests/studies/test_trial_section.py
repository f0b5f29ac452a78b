"""Sections of trials: failures counted case by case, with their interval, and bounds beside."""

from dataclasses import dataclass

from studies import trial_section as module
from studies.plan import StudyOptions
from studies.trial_section import Bound, Case, TrialSection, worst


@dataclass(frozen=True)
class Outcome:
    """Of a number: it falls at odd ones."""

    fell: bool
    size: float


def run_number(number):
    return Outcome(fell=bool(number % 2), size=float(number))


def section(monkeypatch, *cases):
    ran = []

    def run_each(run, kind, trials, progress, options):
        ran.extend(trials)
        return {trial: run(trial) for trial in trials}

    monkeypatch.setattr(module, "run_each", run_each)
    made = TrialSection(
        title="Numbers",
        prose=("Odd ones fall.",),
        run=run_number,
        kind=Outcome,
        cases=lambda options: cases,
        columns={"size, most": worst("size")},
    )
    return made(StudyOptions(), lambda done, total: None), ran


def test_each_case_has_its_findings_and_its_row_and_shared_trials_run_once(monkeypatch):
    even, odd = Case(name="even", trials=[0, 2]), Case(name="odd", trials=[1, 3, 2])
    found, ran = section(monkeypatch, even, odd)
    assert ran == [0, 2, 1, 3]
    assert [(f.name, f.ours, f.ok) for f in found.findings] == [
        ("even: falls in 2 trials", 0, True),
        ("odd: falls in 3 trials", 2, False),
    ]
    assert [row[0] for row in found.tables[0].rows] == ["even", "odd"]
    assert [row[-1] for row in found.tables[0].rows] == [2.0, 3.0]


def test_bounds_are_findings_of_their_own_and_failures_are_what_a_case_says(monkeypatch):
    bounds = tuple(
        Bound(name=f"size to {most:g}", value=worst("size"), most=most, unit="m")
        for most in (3.0, 4.0)
    )
    case = Case(
        name="c", trials=[0, 4], failed=lambda o: o.size > 3.0, what="large ones", bounds=bounds
    )
    found, _ = section(monkeypatch, case)
    assert [(f.name, f.ok) for f in found.findings] == [
        ("c: large ones in 2 trials", False),
        ("c: size to 3", False),
        ("c: size to 4", True),
    ]
