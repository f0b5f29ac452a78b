"""From the lift of a device to the end of its foot's step: states and loads are made up."""

import numpy as np
import pytest
from made_up import MadeUp, leaning

from poise.locomotion import DeviceStatus, Mode, StepEnd

UP = 0.06


@pytest.fixture
def made(get_robot):
    """G1 with its CoM over the left foot."""
    ours = MadeUp(get_robot("g1"))
    ours.q = leaning(ours.robot, 0, 0.0195)
    ours.until(0.1)
    return ours


def lift(made, load=0.03):
    """Lift the right device until its foot may leave the ground, with a load left on it."""
    made.up, made.loads = (0.0, UP), (1.0 - load, load)
    while not made.mode.single:
        made.tick()
        assert made.time < 2.0
    return made.teleoperator.status


def ended(made):
    return made.teleoperator.status.ended


def test_a_device_lowered_before_the_foot_has_left_gives_both_feet_back(made):
    assert ended(made) is None
    lift(made)
    made.up = (0.0, 0.0)
    made.until(made.time + 0.01)
    assert made.mode is Mode.D
    assert ended(made) is StepEnd.LOWERED


def test_a_device_lowered_after_the_foot_has_left_waits_for_the_ground(made):
    lift(made)
    made.loads = (1.0, 0.0)
    made.until(made.time + 0.06)
    # A foot that scrapes while it is lifted has not landed.
    made.loads = (0.92, 0.08)
    made.tick()
    made.loads, made.up = (1.0, 0.0), (0.0, 0.0)
    made.until(made.time + 0.02)
    assert made.mode is Mode.SL
    assert ended(made) is None
    made.loads = (0.9, 0.1)
    made.until(made.time + 0.01)
    assert made.mode is Mode.D
    assert ended(made) is StepEnd.LANDED
    lift(made)
    assert ended(made) is None


def test_a_foot_that_goes_on_carrying_is_given_back(made):
    lift(made, 0.1)
    begin = made.time
    while made.mode.single:
        made.tick()
    assert made.time - begin == pytest.approx(0.3, abs=0.01)
    assert ended(made) is StepEnd.STUCK


def test_a_shift_that_takes_too_long_says_so(get_robot):
    made = MadeUp(get_robot("g1"))
    made.until(0.1)
    made.up = (0.0, UP)
    made.tick()
    assert made.mode is Mode.TL
    begin = made.time
    while made.mode is Mode.TL:
        made.tick()
    assert made.time - begin == pytest.approx(3.0, abs=0.01)
    assert made.teleoperator.signals()["step_end"] == "LATE"


@pytest.mark.parametrize("alone", [False, True])
def test_a_device_that_is_lost_gives_its_foot_back_and_says_so(get_robot, alone):
    made = MadeUp(get_robot("g1"))
    made.until(0.1)
    made.up = (0.0, UP)
    made.tick()
    made.up = (0.0, np.nan) if alone else None
    begin = made.time
    while made.mode is Mode.TL:
        made.tick()
    assert made.time - begin == pytest.approx(0.5, abs=0.01)
    assert ended(made) is StepEnd.LOST
    lost = DeviceStatus.WAITING if alone else DeviceStatus.LOST
    assert made.teleoperator.status.device is lost


def test_a_lift_is_a_rising_edge_with_hysteresis(get_robot):
    """Up at the start does not count; nor does a rise from between the two heights."""
    made, seen = MadeUp(get_robot("g1")), []
    made.until(0.01)
    for height in (0.015, 0.019, 0.012, 0.021, 0.015, 0.005):
        made.up = (0.0, height)
        made.tick()
        seen.append(made.mode)
    assert seen == [Mode.D, Mode.D, Mode.D, Mode.TL, Mode.TL, Mode.D]


def test_where_a_swing_foot_is_sent(made):
    """It is neither dragged over the ground nor pushed into it; without a device straight down."""
    status, parameters = lift(made), made.teleoperator.parameters
    sole, anchor = status.soles[1], made.teleoperator.estimator.anchors[1].copy()

    def target(up, ahead=0.0):
        made.up, made.ahead = None if up is None else (0.0, up), ahead
        made.tick()
        return made.teleoperator.status.target

    assert target(0.012)[2] >= sole[2] - 1e-9
    made.loads = (1.0, 0.0)
    made.until(made.time + 0.06)
    np.testing.assert_allclose(target(0.05, 0.01), [*sole[:2], anchor[2] + 0.05], atol=2e-3)
    lowest = min(a[2] for a in made.teleoperator.estimator.anchors) - parameters.press_depth
    for _ in range(80):
        deepest = target(-0.2)
    assert deepest[2] == pytest.approx(lowest, abs=1e-6)
    for _ in range(260):
        down = target(None)
    assert down[2] == pytest.approx(lowest, abs=1e-6)


def test_a_swing_foot_stays_on_its_side_within_a_step_and_below_its_highest(made):
    """The robot has its right foot in the air, clear of the ground."""
    lift(made)
    made.loads = (1.0, 0.0)
    for joint, angle in (("hip_pitch", -0.35), ("knee", 0.7), ("ankle_pitch", -0.35)):
        made.turn(f"right_{joint}_joint", angle)
    made.until(made.time + 0.06)
    p, robot = made.teleoperator.parameters, made.robot
    stance, width = made.teleoperator.estimator.anchors[0], next(iter(robot.soles.values())).width
    for ahead, aside, up in ((0.6, 0.0, 0.06), (0.0, 0.4, 0.06), (0.0, 0.0, 0.6)):
        start = made.ahead, made.aside, made.up[1]
        for k in range(1, 201):
            made.ahead, made.aside = start[0] + k / 200 * ahead, start[1] + k / 200 * aside
            made.up = (0.0, start[2] + k / 200 * (up - start[2]))
            made.tick()
        x, y, z = made.teleoperator.status.target - stance
        assert x <= p.step_max + 1e-9
        assert y <= -width
        assert z <= p.lift_max + 1e-9
