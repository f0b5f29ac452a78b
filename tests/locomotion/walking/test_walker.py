"""The walker by itself, on a robot that does not move: what it sets, and how it gives up."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import poise
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import Gait, Stride, Walker, WalkSettings, plan_footsteps, walking_stack
from poise.locomotion._walking._settings import WalkStatus

DT = 0.01
GAIT = Gait(step_time=0.8, double_support=0.2, crouch=0.02, shift_time=0.4)
BLIND = WalkSettings(com_bound=100.0)
"""A robot that stands still is far from where it should be: that is not what is looked at here."""

AHEAD = (Stride(steps=3, length=0.1),)


class Frozen:
    """A robot that stands as at the start whatever it is told, with a clock and felt forces."""

    def __init__(self, robot, *, strides=AHEAD, settings=BLIND):
        self.robot, self.stack = robot, walking_stack(robot)
        self.plan = plan_footsteps(robot, strides, GAIT)
        self.walker = Walker(robot, self.plan, self.stack, settings)
        self.time = 0.0
        self.velocity = np.zeros(robot.nv)

    def state(self, **loads):
        contacts = {name: np.array([0, 0, f, 0, 0, 0], float) for name, f in loads.items()}
        return poise.RobotState(self.robot.q_home, self.velocity, contacts, self.time)

    def tick(self, **loads):
        self.walker.lead(self.state(**loads))
        for contact in self.stack.contacts:
            contact.advance(self.time)
        self.time = round(self.time + DT, 9)
        return self.walker.status

    def until(self, time, **loads):
        while self.time < time - 0.5 * DT:
            self.tick(**loads)
        return self.walker.status

    def active(self):
        return tuple(contact.active for contact in self.stack.contacts)


@pytest.fixture
def frozen(get_robot):
    return lambda **options: Frozen(get_robot("humanoid33"), **options)


def test_the_first_foot_is_unloaded_before_it_is_lifted(frozen):
    robot = frozen()
    lift = robot.plan.lift_off(0)
    robot.until(lift - 0.02)
    assert robot.active() == (True, True)
    assert robot.stack.contacts[0].wrench_upper[2] < 0.5 * 9.81 * robot.robot.mass
    robot.until(lift + 0.05, left_sole=0.0)
    assert robot.active() == (False, True)
    foot = robot.stack.task("left_foot")
    assert foot.target_position[2] > 0.0


def test_a_foot_is_loaded_when_it_feels_the_ground_late_in_its_swing(frozen):
    robot = frozen()
    begin, end = robot.plan.lift_off(0), robot.plan.touchdown(0)
    robot.until(begin + 0.4 * (end - begin), left_sole=200.0)
    assert robot.walker.steps_made == 0  # it scraped, which is no touchdown
    robot.until(end - 0.1, left_sole=0.0)
    assert robot.walker.steps_made == 0
    robot.tick(left_sole=200.0)
    assert robot.walker.steps_made == 1
    assert robot.active() == (True, True)


def test_without_force_sensors_a_foot_is_down_when_it_should_be(frozen):
    robot = frozen()
    robot.until(robot.plan.touchdown(0) - 0.03)
    assert robot.walker.steps_made == 0
    robot.until(robot.plan.touchdown(0) + 0.05)
    assert robot.walker.steps_made == 1


def test_the_clock_waits_for_a_foot_that_is_late(frozen):
    robot = frozen()
    end = robot.plan.touchdown(0)
    robot.until(end + 0.3, left_sole=0.0)
    assert robot.walker.clock < end + 0.1
    robot.tick(left_sole=200.0)
    assert robot.walker.steps_made == 1
    robot.until(end + 0.4, left_sole=200.0)
    assert robot.walker.clock > end + 0.1


def test_a_foot_that_never_lands_ends_the_walk_with_all_targets_at_rest(frozen):
    robot = frozen()
    status = robot.until(robot.plan.touchdown(0) + 0.7, left_sole=0.0)
    assert status is WalkStatus.FOOT_LOST
    assert not status.ok
    robot.until(robot.time + 1.0, left_sole=0.0)
    foot, com = robot.stack.task("left_foot"), robot.stack.task("com")
    before = foot.target_position.copy(), com.target_position.copy()
    robot.until(robot.time + 3.0, left_sole=0.0)
    np.testing.assert_array_equal(before[0], foot.target_position)
    np.testing.assert_array_equal(before[1], com.target_position)
    # Not deeper than it may look, and the COM over the foot that stands.
    settings = robot.walker.settings
    lowest = robot.plan.start[0].position[2] - settings.touchdown_depth - settings.search_depth
    assert foot.target_position[2] >= lowest - 1e-9
    np.testing.assert_allclose(com.target_position[1], robot.plan.start[1].position[1], atol=1e-6)
    # If the ground comes after all, it is stood on, and no foot is lifted any more.
    robot.until(robot.time + 2.0, left_sole=200.0)
    assert robot.active() == (True, True)
    assert robot.walker.status is WalkStatus.FOOT_LOST


@pytest.mark.parametrize("phase", [-0.1, 0.5], ids=["both feet down", "one in the air"])
def test_a_com_that_runs_away_ends_the_walk(frozen, phase):
    robot = frozen(settings=WalkSettings())
    robot.until(robot.plan.lift_off(0) + phase * GAIT.swing_time, left_sole=0.0)
    assert robot.walker.status is WalkStatus.WALKING
    robot.velocity[0] = 2.0
    robot.tick(left_sole=0.0)
    assert robot.walker.status is WalkStatus.COM_LOST
    robot.velocity[0] = 0.0
    robot.until(8.0, left_sole=200.0, right_sole=200.0)
    assert robot.walker.status is WalkStatus.COM_LOST
    assert robot.walker.steps_made == (1 if phase > 0.0 else 0)
    assert robot.active() == (True, True)


def test_a_walk_goes_through_to_its_end(frozen):
    robot = frozen()
    while robot.time < robot.plan.duration + 1.0:
        robot.tick()
    assert robot.walker.status is WalkStatus.FINISHED
    assert robot.walker.steps_made == robot.plan.count == 4
    assert robot.active() == (True, True)


def test_a_robot_that_does_not_stand_where_the_plan_begins_is_not_moved(frozen):
    robot = frozen()
    q = robot.robot.q_home.copy()
    q[0] += 0.2
    robot.walker.lead(replace(robot.state(), q=q))
    assert robot.walker.status is WalkStatus.MISPLACED
    assert robot.stack.task("com").target_position is None
    assert robot.until(3.0) is WalkStatus.MISPLACED
    assert robot.active() == (True, True)


@pytest.mark.parametrize("time", [0.0, 0.9])
def test_a_state_that_is_not_finite_is_passed_over(frozen, time):
    robot = frozen()
    robot.until(time)
    before = robot.walker.status
    v = np.zeros(robot.robot.nv)
    v[3] = np.nan
    robot.walker.lead(replace(robot.state(), v=v))
    assert robot.walker.status is before
    assert robot.tick().ok


def test_clocks_that_jump_end_in_a_status_and_not_in_an_error(frozen):
    robot = frozen()
    for time in itertools.chain([0.0, 3.0, 1.0, 1.0, 50.0, 0.2], np.linspace(0.0, 9.0, 60)):
        robot.time = float(time)
        robot.tick(left_sole=0.0)
    assert robot.walker.status in WalkStatus


def test_a_clock_that_jumps_moves_the_walk_on_by_a_twentieth_of_a_second(frozen):
    robot = frozen()
    robot.until(0.1)
    before = robot.walker.clock
    for jump, moved in ((0.03, 0.03), (2.0, 0.05), (-1.0, 0.0)):
        robot.time += jump - DT
        robot.tick()
        assert robot.walker.clock - before == pytest.approx(moved)
        before = robot.walker.clock


def test_what_goes_along_turns_with_the_body(frozen):
    robot = frozen(strides=(Stride(steps=4, turn=0.1),))
    hand = robot.walker.carried["left_hand"]
    begin = hand.target_position.copy()
    hand.set_target(begin + np.array([0.1, 0.0, 0.05]), np.zeros(3), np.zeros(3))
    while robot.time < robot.plan.duration + 0.5:
        robot.tick()
    turn = 4 * 0.1
    center = np.array(robot.plan.com)
    arm = begin + np.array([0.1, 0.0, 0.05]) - center
    c, s = np.cos(turn), np.sin(turn)
    went = robot.stack.task("com").target_position - center
    wanted = center[:2] + went[:2] + np.array([[c, -s], [s, c]]) @ arm[:2]
    np.testing.assert_allclose(robot.stack.task("left_hand").target_position[:2], wanted, atol=1e-6)
    np.testing.assert_allclose(robot.stack.task("pelvis").target_rotation[:2, 0], [c, s], atol=1e-6)


def without(stack, name):
    levels = [[t for t in level if t.name != name] for level in stack.levels]
    contacts = [c for c in stack.contacts if c.name != name]
    return poise.Stack(contacts, [level for level in levels if level])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("com", "a ComTask of all three axes"),
        ("left_foot", "a FrameTask of the pose of 'left_sole'"),
        ("right_sole", "a contact on 'right_sole'"),
    ],
)
def test_a_stack_that_cannot_walk_is_refused(get_robot, name, message):
    robot = get_robot("humanoid33")
    plan = plan_footsteps(robot, [Stride(steps=2, length=0.1)], GAIT)
    with pytest.raises(ConfigurationError, match=message):
        Walker(robot, plan, without(walking_stack(robot), name))


def test_a_task_to_carry_that_does_not_exist_is_refused(get_robot):
    robot = get_robot("humanoid33")
    plan = plan_footsteps(robot, [Stride(steps=2, length=0.1)], GAIT)
    with pytest.raises(UnknownNameError, match=r"third_hand.*left_hand"):
        Walker(robot, plan, walking_stack(robot), carry=["third_hand"])


@pytest.mark.parametrize("robot", ["humanoid33", "g1"])
@pytest.mark.parametrize(
    "stride",
    [Stride(steps=4, length=0.6), Stride(steps=4, sideways=0.35)],
    ids=["too long", "too wide"],
)
def test_steps_beyond_the_legs_are_refused_before_anything_moves(get_robot, robot, stride):
    robot = get_robot(robot)
    plan = plan_footsteps(robot, [stride], GAIT)
    with pytest.raises(ConfigurationError, match="is out of reach.*wanted shorter steps"):
        Walker(robot, plan, walking_stack(robot))


@pytest.mark.parametrize(
    "values", [{"dcm_gain": 0.0}, {"early": 1.5}, {"patience": -1.0}, {"adjust": float("nan")}]
)
def test_settings_that_cannot_be_right_are_refused(values):
    with pytest.raises(ConfigurationError):
        WalkSettings(**values)
