"""The study of torque-level teleoperation: its trials, and what their findings allow."""

import math
from dataclasses import replace
from importlib import import_module
from unittest.mock import Mock

import numpy as np
import pytest

from poise.locomotion import Mode, StepTeleoperator

pytest.importorskip("mujoco")

from poise.apps.teleoperation import MODES, TeleopLog
from studies.torque_teleoperation.again_section import (
    Outcome as AgainOutcome,
    Trial as AgainTrial,
    _finding as again_finding,
    _row as again_row,
    run_trial as run_again,
)
from studies.torque_teleoperation.cuts_section import (
    Outcome as CutOutcome,
    Trial,
    _finding,
    _row,
    run_trial,
)
from studies.torque_teleoperation.edges_section import (
    Outcome as EdgeOutcome,
    Trial as EdgeTrial,
    _bump,
    _finding as edge_finding,
    _points,
    run_trial as run_edge,
)
from studies.torque_teleoperation.hands_section import (
    DOINGS,
    Outcome as HandsOutcome,
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
from studies.torque_teleoperation.scenarios_section import shift_times


def shift_log(modes, off, dt=0.01):
    """A log of modes [s], whose ZMP is beside its reference [m] as a function of time [s]."""
    lasts = [(mode, round(seconds / dt)) for mode, seconds in modes]
    mode = np.array([MODES.index(m) for m, n in lasts for _ in range(n)], dtype=np.int8)
    time, T = dt * np.arange(len(mode)), len(mode)
    log = Mock(spec=TeleopLog, time=time, mode=mode, zmp_reference=np.zeros((T, 2)))
    log.zmp = np.column_stack([np.zeros(T), [off(t) for t in time]])
    log.__len__ = lambda _: T
    for name in ("when", "entries"):
        setattr(log, name, getattr(TeleopLog, name).__get__(log))
    return log


SHIFT = [(Mode.D, 1.0), (Mode.TL, 0.4), (Mode.SL, 1.0), (Mode.D, 1.0)]


def test_a_shift_takes_until_the_foot_is_up_and_the_zmp_stays_where_it_should_be():
    # Through its reference at 1.2 s without staying there; from 1.7 s on it stays.
    log = shift_log(SHIFT, lambda t: 0.0 if t < 1.0 or 1.2 <= t < 1.25 or t >= 1.7 else 0.05)
    assert shift_times(log) == pytest.approx((0.4, 0.7), abs=0.011)


@pytest.mark.parametrize(
    ("modes", "times"),
    [
        (SHIFT, (0.4, np.inf)),
        (SHIFT[:2], (np.nan, np.nan)),
        ([(Mode.D, 1.0), (Mode.TR, 0.6), (Mode.SR, 1.0)], (0.6, 1.35)),
    ],
)
def test_a_zmp_that_comes_after_the_mode_has_not_settled(modes, times):
    log = shift_log(modes, lambda t: 0.05 if 1.0 <= t < 2.35 else 0.0)
    assert shift_times(log) == pytest.approx(times, abs=0.011, nan_ok=True)


@pytest.mark.slow
def test_a_foot_in_the_air_comes_down_and_the_robot_rests():
    outcome = run_trial(Trial(robot="biped20", cut=1.6))
    assert outcome.mode == "SR"
    assert not outcome.fell
    assert outcome.rests
    # Half a second of patience, and the way down.
    assert 0.5 < outcome.down_after < 1.5
    assert _row(outcome)[:4] == ("biped20", 1.6, "SR", "no")


def test_a_fall_or_a_robot_that_does_not_rest_fails_the_finding():
    trial = Trial(robot="biped20", cut=1.6)
    outcome = CutOutcome(trial=trial, mode="SR", fell=False, down_after=0.9, rests=True, tilt=0.01)
    assert _finding("biped20", [outcome]).ok
    for bad in (replace(outcome, fell=True), replace(outcome, rests=False)):
        finding = _finding("biped20", [outcome, bad])
        assert (finding.ok, finding.ours) == (False, 1)


def hands_trials(doing):
    """With arms at rest, and with hands moved."""
    return [HandsTrial(doing=doing, moving=moving, seed=0, seconds=3.0) for moving in (False, True)]


@pytest.mark.slow
@pytest.mark.parametrize("doing", DOINGS)
def test_hands_at_random_upset_nothing(doing):
    rest, moved = (run_hands(trial) for trial in hands_trials(doing))
    assert not moved.fell
    assert moved.seconds == pytest.approx(3.0)
    # By how much depends on the arms at rest, too: standing, those have the COM within 3 mm since
    # the attitude's constant error is found; twice that is less than what a moving load costs.
    assert rest.error < 0.02
    assert moved.error < max(0.007, 1.5 * rest.error)
    assert hands_row(moved)[:4] == ("g1", moved.trial.doing, "moved, 1 kg", "no")


def test_a_fall_or_a_com_that_is_further_off_fails_the_finding():
    rest, moved = (
        HandsOutcome(trial=trial, fell=False, seconds=3.0, error=0.01, tilt=0.1, lag=0.1)
        for trial in hands_trials("stepping")
    )
    assert hands_finding(rest, replace(moved, error=1.9 * rest.error)).ok
    for bad in (replace(moved, fell=True), replace(moved, error=2.1 * rest.error)):
        assert not hands_finding(rest, bad).ok


def test_either_foot_is_held_at_the_same_place_from_where_it_stood(get_robot):
    teleoperator = StepTeleoperator(get_robot("g1"), actuation="torque")
    start, offsets = teleoperator.estimator.anchors, []
    for left in (True, False):
        held = _hand(teleoperator, 7, left=left).sample(4.0)
        foot = 0 if left else 1
        np.testing.assert_array_equal(held.place(1 - foot), start[1 - foot])
        offsets.append(held.place(foot) - start[foot])
    np.testing.assert_allclose(offsets[0], [0.15, 0.1, 0.12])
    np.testing.assert_allclose(offsets[1], [0.15, -0.1, 0.12])


def test_a_bump_reaches_under_the_sole_and_the_hands_go_on_in_time(get_robot):
    sole, rng = get_robot("g1").soles["right_sole"], np.random.default_rng(0)
    off = np.array([_bump(get_robot("g1"), np.zeros(2), rng).center for _ in range(200)])
    assert (np.abs(off) <= 0.6 * np.array([sole.length, sole.width])).all()
    assert (np.ptp(off, axis=0) > np.array([sole.length, sole.width])).all()
    points = _points(0.2, 0.015, rng)
    for side in ("left", "right"):
        times = [point.at for point in points if getattr(point, side) is not None]
        assert times == sorted(set(times))


@pytest.mark.slow
def test_on_the_edge_of_a_bump_it_stands_or_steps():
    outcome = run_edge(EdgeTrial(robot="g1", seed=14))
    assert not outcome.fell
    assert outcome.alone > 0.1
    assert outcome.tilt < 0.2


def test_no_fall_is_allowed_on_the_edge_of_a_bump():
    trial = EdgeTrial(robot="g1", seed=0)
    stands = EdgeOutcome(trial=trial, fell=False, alone=1.0, stepped=True, tilt=0.1)
    assert edge_finding([stands] * 20).ok
    assert not edge_finding([stands] * 19 + [replace(stands, fell=True)]).ok


def test_one_fall_in_ten_minutes_of_pushes_is_allowed():
    trial = HeldTrial(place=0, direction=90, seed=0)
    stands = HeldOutcome(trial=trial, fell=False, up=True, stepped=False, tilt=0.1)
    falls = replace(stands, fell=True)
    assert held_finding([stands] * 119 + [falls]).ok
    assert not held_finding([stands] * 118 + [falls]).ok


def test_fates_have_the_same_ground_and_pushes_and_other_sensors(get_robot, monkeypatch):
    mass = get_robot("g1").mass
    asked = []

    def ask(_, device, plant, **options):
        asked.append((plant, options))
        raise InterruptedError

    module = import_module("studies.torque_teleoperation.again_section")
    monkeypatch.setattr(module, "run_teleop", ask)
    for seed, fate in ((3, 0), (3, 1), (4, 0)):
        with pytest.raises(InterruptedError):
            run_again(AgainTrial(seed=seed, fate=fate))
    (plant, options), (same_plant, same), (other_plant, other) = asked
    assert plant == same_plant != other_plant
    assert options["pushes"] == same["pushes"] != other["pushes"]
    assert len({o["seed"] for o in (options, same, other)}) == 3
    (first, _, length), (second, _, _) = options["pushes"]
    dt = plant.control_dt
    assert 3.0 <= first * dt <= 5.0
    assert 0.25 <= (second - first) * dt <= 1.15
    for (_, force, _), speed in zip(options["pushes"], (0.45, 0.2), strict=True):
        assert math.hypot(*force) * length / mass == pytest.approx(speed)


def test_one_fall_in_37_trials_is_allowed_of_a_robot_that_catches_itself():
    trial = AgainTrial(seed=0, fate=0)
    stands = AgainOutcome(trial=trial, fell=False, stepped=True, seconds=2.8, tilt=0.1)
    falls = replace(stands, fell=True, seconds=1.0)
    assert again_finding([stands] * 36 + [falls]).ok
    assert not again_finding([stands] * 35 + [falls]).ok
    assert again_row([stands, falls])[1:5] == (2, 2, 1, 1.0)
