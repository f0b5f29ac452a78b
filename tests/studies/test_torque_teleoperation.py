"""The study of torque-level teleoperation: connections cut in mid-step, and hands at random."""

from dataclasses import replace

import pytest

pytest.importorskip("mujoco")

from studies.torque_teleoperation.cuts_section import Trial, _finding, _row, run_trial
from studies.torque_teleoperation.hands_section import (
    DOINGS,
    Trial as HandsTrial,
    _finding as hands_finding,
    _row as hands_row,
    run_trial as run_hands,
)


@pytest.fixture(scope="module")
def outcome():
    """Of a foot that is in the air."""
    return run_trial(Trial(robot="biped20", cut=1.6))


def test_a_foot_in_the_air_comes_down_and_the_robot_rests(outcome):
    assert outcome.mode == "SR"
    assert not outcome.fell
    assert outcome.rests
    # Half a second of patience, and the way down.
    assert 0.5 < outcome.down_after < 1.5
    assert _row(outcome)[:4] == ("biped20", 1.6, "SR", "no")


def test_a_fall_or_a_robot_that_does_not_rest_fails_the_finding(outcome):
    assert _finding("biped20", [outcome]).ok
    for bad in (replace(outcome, fell=True), replace(outcome, rests=False)):
        finding = _finding("biped20", [outcome, bad])
        assert (finding.ok, finding.ours) == (False, 1)


@pytest.fixture(scope="module", params=DOINGS)
def pair(request):
    """With arms at rest, and with hands moved."""
    return [
        run_hands(HandsTrial(doing=request.param, moving=moving, seed=0, seconds=3.0))
        for moving in (False, True)
    ]


def test_hands_at_random_upset_nothing(pair):
    rest, moved = pair
    assert not moved.fell
    assert moved.seconds == pytest.approx(3.0)
    # By how much depends on the arms at rest, too: standing, those have the COM within 3 mm since
    # the attitude's constant error is found; twice that is less than what a moving load costs.
    assert rest.error < 0.02
    assert moved.error < max(0.007, 1.5 * rest.error)
    assert hands_row(moved)[:4] == ("g1", moved.trial.doing, "moved, 1 kg", "no")


def test_a_fall_or_a_com_that_is_further_off_fails_the_finding(pair):
    rest, moved = pair
    assert hands_finding(rest, replace(moved, error=1.9 * rest.error)).ok
    for bad in (replace(moved, fell=True), replace(moved, error=2.1 * rest.error)):
        assert not hands_finding(rest, bad).ok
