"""The study of locomotion: what it asks of outcomes, whatever they are."""

from dataclasses import replace

import pytest

pytest.importorskip("mujoco")

from poise.errors import UnknownNameError
from studies import trial_section
from studies.locomotion.estimated_walk import Outcome, Trial, cell_fault
from studies.locomotion.estimation import estimation_section
from studies.plan import StudyOptions

GOOD = Outcome(
    trial=Trial(robot="g1", seed=0, seconds=1.0),
    fell=False,
    way=5.0,
    velocity_rms=0.01,
    tilt_rms=0.002,
    drift=0.01,
    height=0.01,
    nees=5.0,
)


def failed(monkeypatch, section, good, change):
    """Names of the findings that do not hold, and the number of all."""

    def run(_, kind, trials, progress, options):
        return {trial: replace(good, trial=trial, **change(trial)) for trial in trials}

    monkeypatch.setattr(trial_section, "run_each", run)
    found = section(StudyOptions(), lambda done, total: None).findings
    return [f.name for f in found if not f.ok], len(found)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({}, None),
        ({"fell": True}, "g1: falls in 20 trials"),
        ({"velocity_rms": 0.06}, "g1: velocity error, rms"),
        ({"tilt_rms": 0.01}, "g1: tilt error, rms"),
        ({"drift": 0.03}, "g1: drift over the way"),
        ({"nees": 200.0}, "g1: NEES of tilt and velocity"),
    ],
)
def test_one_bad_seed_of_a_robot_fails_that_finding_alone(monkeypatch, change, name):
    bad = Trial(robot="g1", seed=3, seconds=60.0)
    names, count = failed(
        monkeypatch, estimation_section, GOOD, lambda t: change if t == bad else {}
    )
    assert names == ([] if name is None else [name])
    assert count == 17


def test_a_fault_that_does_not_exist_is_refused(get_robot):
    with pytest.raises(UnknownNameError, match="stuck"):
        cell_fault(get_robot("g1"), "cracked", 0)
