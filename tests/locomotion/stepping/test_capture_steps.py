"""Pushed, the robot steps by itself where the feet as they are led cannot hold it."""

import math

import numpy as np
import pinocchio as pin
import pytest
from made_up import MadeUp
from slow import slow
from walker import hands, sample

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.locomotion import DeviceStatus, Mode, StepTeleoperator, WayPoint

STATUSES, MODES = list(DeviceStatus), list(Mode)

PUSHED_AT, PUSH_TIME = 1.6, 0.1


def pushed(robot, speed, degrees, points, duration, at=PUSHED_AT):
    """A run in which the torso is pushed: a change of speed [m/s], where to, and when [s]."""
    angle, force = math.radians(degrees), robot.mass * speed / PUSH_TIME
    push = (force * math.cos(angle), force * math.sin(angle), 0.0)
    number = round(at / TORQUE_TELEOP_PLANT.control_dt)
    plant = TORQUE_TELEOP_PLANT.with_noise()
    pushes = [(number, push, PUSH_TIME)]
    return run_teleop(robot, hands(*points), plant, duration=duration, pushes=pushes)


def held(height):
    """The left foot held up, put down by the hand later, and lifted again."""
    places = ((0.2, 0.0), (0.8, height), (2.6, height), (3.0, -0.02), (3.1, -0.02), (3.5, 0.06))
    return [WayPoint(at=at, left=(0.0, 0.0, z)) for at, z in places]


def overruled(log):
    return log.device == STATUSES.index(DeviceStatus.OVERRULED)


def test_g1_on_one_foot_catches_itself_and_the_operator_takes_hold_anew(get_robot):
    """To the side of the foot in the air, which comes down there."""
    run = pushed(get_robot("g1"), 0.2, 90, held(0.06), 4.6)
    log, double = run.log, MODES.index(Mode.D)
    assert not run.fell
    own = overruled(log)
    assert not own[log.time < PUSHED_AT].any()
    assert own.any()
    # The hand is still up: nothing follows it until it has come down to its foot.
    after = (log.time > log.time[own][-1]) & (log.time < 3.0)
    assert (log.mode[after] == double).all()
    assert (log.device[after] == STATUSES.index(DeviceStatus.WAITING)).any()
    # Down, and up again: its foot follows.
    assert log.mode[-1] == MODES.index(Mode.SR)
    assert log.soles[-1, 0, 2] > 0.03
    assert not own[log.time > 3.1].any()
    # Why the foot came down is said until it is lifted again.
    ends = run.record.notes("step_end")
    assert [end for _, end in ends] == ["", "OVERRULED", ""]
    lifted = [at for at, mode in run.record.notes("mode") if mode == "TR"][-1]
    assert ends[-1][0] == pytest.approx(lifted)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [60, 143])
def test_a_foot_that_is_up_and_behind_comes_down_and_is_not_thrown(get_robot, degrees):
    """To the foot's side: balanced by the trunk alone, the leg would be swung up against it."""
    places = ((0.2, 0.0, 0.0), (0.6, 0.0, 0.12), (1.1, -0.3, 0.15))
    points = [WayPoint(at=at, left=(x, 0.0, z)) for at, x, z in places]
    run = pushed(get_robot("g1"), 0.2, degrees, points, 3.0)
    log = run.log
    after = log.time > PUSHED_AT
    assert not run.fell
    assert overruled(log).any()
    assert log.soles[after, 0, 2].max() < log.soles[~after, 0, 2][-1] + 0.01
    assert log.mode[-1] == MODES.index(Mode.D)
    assert log.tilt.max() < 0.2


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "degrees"), [(0.45, 0), (0.45, 180), (0.5, 45)])
def test_both_feet_on_the_ground_it_steps_and_comes_to_rest(get_robot, speed, degrees):
    robot = get_robot("g1")
    run = pushed(robot, speed, degrees, [], 4.5)
    log = run.log
    assert not run.fell
    assert overruled(log).any()
    assert log.mode[-1] == MODES.index(Mode.D)
    assert log.device[-1] != STATUSES.index(DeviceStatus.OVERRULED)
    assert np.linalg.norm(log.com[-1, :2] - log.zmp_reference[-1]) < 0.02
    # What its steps learned of the soles has grown to all of them again.
    whole = StepTeleoperator(robot, actuation="torque")
    for contact, new in zip(run.teleoperator.stack.contacts, whole.stack.contacts, strict=True):
        np.testing.assert_allclose(contact.cone, new.cone, atol=1e-12)


@pytest.mark.slow
def test_feet_that_stand_too_far_apart_to_be_led_are_brought_together_again(get_robot):
    """From twice as far apart as at home no shift takes the CoM over one foot."""
    run = pushed(get_robot("g1"), 0.65, 75, [], 8.0)
    log = run.log
    apart = log.soles[:, 0, 1] - log.soles[:, 1, 1]
    assert not run.fell
    assert apart.max() > 0.4
    assert 0.2 < apart[-1] < 0.3
    # So long at most it steps for that.
    assert not overruled(log)[log.time > PUSHED_AT + 6.0].any()
    # The trunk leans for the push, and not for what comes after it.
    assert log.tilt[log.time > PUSHED_AT + 2.0].max() < 0.3


def test_a_foot_that_stands_and_hangs_is_put_down(get_robot):
    """Both feet on the ground by their mode; states are made up."""
    made, overruled = MadeUp(get_robot("g1")), []
    for tick in range(75):
        made.loads = (0.5, 0.5) if tick < 20 else (0.0, 1.0)
        made.up = None
        made.tick()
        overruled.append(made.overruled)
    # Not in less than 50 ms.
    assert not any(overruled[: round(0.088 / 0.002)])
    assert all(overruled[round(0.1 / 0.002) :])
    assert made.mode is Mode.SR


@pytest.fixture
def hung(get_robot):
    """Make a g1 that steps because its left foot hangs; states are made up."""
    made = MadeUp(get_robot("g1"))
    made.until(0.02)
    made.loads = (0.0, 1.0)
    made.until(0.15)
    assert made.overruled
    return made


def test_the_balance_outweighs_the_trunk_while_the_robot_steps_by_itself(get_robot):
    """And the operator's trunk and feet weigh what they did, once they are the operator's again."""
    made = MadeUp(get_robot("g1"))
    tasks = {task.name: task for level in made.teleoperator.stack.levels for task in level}
    made.tick()
    before = {name: task.weight.copy() for name, task in tasks.items()}
    made.loads = (0.0, 1.0)
    made.until(0.15)
    assert made.overruled
    least = tasks["com"].weight.min()
    for name in ("pelvis orientation", "torso orientation"):
        assert tasks[name].weight.max() <= 0.3 * least
    # A foot that is late costs the balance, too.
    for sole in made.teleoperator.soles:
        np.testing.assert_allclose(tasks[f"{sole} foot"].weight[:3], least)
    made.stand_again()
    weights = [tasks["com"].weight[0]]
    for _ in range(160):
        made.tick()
        weights.append(tasks["com"].weight[0])
    # What is before everything again does not begin to be so with a jump.
    assert weights[0] < 1.1 * least
    assert np.diff(np.log(weights)).max() < 0.1
    for name in ("com", "pelvis orientation", "torso orientation"):
        np.testing.assert_allclose(tasks[name].weight, before[name])


@pytest.mark.parametrize("lean", [0.1, 0.6, -2.0])
def test_a_trunk_that_was_thrown_over_is_led_back_little_by_little(hung, lean):
    """All the way, it would be asked for more than the balance can spare."""
    robot, teleoperator = hung.robot, hung.teleoperator
    hung.q[3:7] = [math.sin(lean / 2.0), 0.0, 0.0, math.cos(lean / 2.0)]
    hung.tick()
    assert hung.overruled
    named = {task.name: task for level in teleoperator.stack.levels for task in level}
    for frame in (robot.pelvis, robot.torso):
        _, here = teleoperator.estimator.dynamics.placement(robot.frame_id(frame))
        step = pin.log3(here.T @ named[f"{frame} orientation"].target_rotation)
        back = pin.log3(here.T)
        far = min(np.linalg.norm(back), 0.2)
        np.testing.assert_allclose(step, far * back / np.linalg.norm(back), atol=1e-9)


class WalksThenSteps:
    """Devices on the feet: the robot walks for two seconds, and later its left foot is lifted."""

    def __init__(self, teleoperator, height=0.0):
        self._anchors, self._height = teleoperator.estimator, height

    def sample(self, time):
        left, right = (anchor.copy() for anchor in self._anchors.anchors)
        left[2] += 0.06 if time > 5.2 else 0.0
        if 0.5 < time < 1.0:
            left[2] += self._height
        velocity = (0.3, 0.0, 0.0) if 1.0 < time < 2.2 else (0.0, 0.0, 0.0)
        return sample(time, left, right, velocity=velocity)


@pytest.mark.parametrize("height", [0.0, slow(0.06)], ids=["both feet down", "one held up"])
def test_walking_by_velocity_and_stepping_by_hand_change_over(get_robot, height):
    plant = TORQUE_TELEOP_PLANT.with_noise()
    run = run_teleop(
        get_robot("g1"), lambda t: WalksThenSteps(t, height), plant, duration=6.2, pushes=()
    )
    log = run.log
    assert not run.fell
    walks = log.device == STATUSES.index(DeviceStatus.WALKING)
    began, ended = log.time[walks][[0, -1]]
    assert began == pytest.approx(1.0, abs=0.01)
    assert 2.5 < ended < 5.0
    assert log.com[-1, 0] - log.com[0, 0] > 0.24
    # It stands, feet side by side, and the operator's foot is led again.
    then = np.searchsorted(log.time, 5.1)
    assert log.mode[then] == MODES.index(Mode.D)
    assert abs(log.soles[then, 0, 0] - log.soles[then, 1, 0]) < 0.03
    assert log.mode[-1] == MODES.index(Mode.SR)
    assert log.soles[-1, 0, 2] > 0.03
    # Nothing jumps where one hands over to the other.
    assert np.abs(np.diff(log.com, axis=0)).max() < 0.005
    assert log.tilt.max() < 0.3


class StickInMidStep:
    """The right foot is held up, and a stick is pushed ahead meanwhile."""

    def __init__(self, teleoperator):
        self._left, self._right = teleoperator.estimator.anchors

    def sample(self, time):
        up = np.array([0.0, 0.0, min(max(0.2 * (time - 0.6), 0.0), 0.06)])
        velocity = (0.3 if time >= PUSHED_AT else 0.0, 0.0, 0.0)
        return sample(time, self._left, self._right + up, velocity=velocity)


def test_a_stick_in_mid_step_makes_no_jump_of_the_zmp(get_robot):
    """At once, the walk would have it at an edge of the sole that stands, nearly 10 cm away."""
    run = run_teleop(get_robot("biped20"), StickInMidStep, TORQUE_TELEOP_PLANT, duration=1.8)
    log = run.log
    assert not run.fell
    assert MODES[log.mode[log.time < PUSHED_AT][-1]] is Mode.SL
    driven = log.device == STATUSES.index(DeviceStatus.WALKING)
    assert driven[-1]
    steps = np.linalg.norm(np.diff(log.zmp_reference, axis=0), axis=1)
    assert steps[log.time[1:] > PUSHED_AT - 0.1].max() < 0.01
