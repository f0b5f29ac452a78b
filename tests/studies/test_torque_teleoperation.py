"""The study of torque-level teleoperation: connections cut in mid-step, and hands at random."""

from dataclasses import replace

import numpy as np
import pytest

from poise.locomotion import StepTeleoperator

pytest.importorskip("mujoco")

from studies.torque_teleoperation.cuts_section import Trial, _finding, _row, run_trial
from studies.torque_teleoperation.hands_section import (
    DOINGS,
    Trial as HandsTrial,
    _finding as hands_finding,
    _row as hands_row,
    run_trial as run_hands,
)
from studies.torque_teleoperation.held_section import (
    Outcome as HeldOutcome,
    Trial as HeldTrial,
    _finding as held_finding,
    _hand,
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


def test_either_foot_is_held_at_the_same_place_from_where_it_stood(get_robot):
    teleoperator = StepTeleoperator(get_robot("g1"), actuation="torque")
    start = teleoperator.resting_sample
    offsets = []
    for left in (True, False):
        held = _hand(teleoperator, 7, left=left).sample(4.0)
        moved, still = (held.left, held.right) if left else (held.right, held.left)
        np.testing.assert_array_equal(still, start.right if left else start.left)
        offsets.append(moved - (start.left if left else start.right))
    np.testing.assert_allclose(offsets[0], [0.15, 0.1, 0.12])
    np.testing.assert_allclose(offsets[1], [0.15, -0.1, 0.12])


def test_one_fall_in_ten_minutes_of_pushes_is_allowed():
    trial = HeldTrial(place=0, direction=90, seed=0)
    stands = HeldOutcome(trial=trial, fell=False, up=True, stepped=False, tilt=0.1)
    falls = replace(stands, fell=True)
    assert held_finding([stands] * 119 + [falls]).ok
    assert not held_finding([stands] * 118 + [falls]).ok
