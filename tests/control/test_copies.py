"""Robots, stacks and controllers are copied and pickled: the copy goes on as the original would."""

import copy
import multiprocessing
import pickle
from types import MappingProxyType

import numpy as np
import pytest

import poise
from poise.control import CommandStatus
from poise.dynamics import RobotState
from poise.errors import UnknownNameError
from poise.stack import FrameTask, PostureTask, SelfCollisionLimit, Stack, SurfaceContact, Task
from tests.oracles import near_home

EQUAL = 1e-9
"""Relative difference of torques that two searches find which begin differently; seen 0."""


def pickled(thing):
    return pickle.loads(pickle.dumps(thing))


WAYS = {"pickle": pickled, "deepcopy": copy.deepcopy, "twice": lambda c: pickled(pickled(c))}

KINDS = {
    "whole_body": poise.WholeBodyController,
    "cascade": lambda robot, stack: poise.WholeBodyController(robot, stack, strategy="cascade"),
    "reduced": poise.ReducedController,
    "osf": lambda robot, stack: poise.OperationalSpaceController(robot, stack, torque_step=50.0),
    "differential_ik": lambda robot, stack: poise.DifferentialIK(robot, stack, dt=2e-3),
    "differential_ik hqp": lambda robot, stack: poise.DifferentialIK(
        robot, stack, dt=2e-3, strategy="hqp", stance="right_sole"
    ),
}


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


@pytest.fixture(params=WAYS)
def duplicate(request):
    return WAYS[request.param]


class Height(Task):
    """A user's task: the pelvis as high as it was first, and how often it was asked."""

    def __init__(self):
        super().__init__("height", kp=50.0, kd=None, weight=1.0)
        self.target, self.asked = None, []

    def _resolve(self, robot):
        self._pelvis = robot.frame_id(robot.pelvis)
        return 1

    def _evaluate(self, dynamics):
        frame = dynamics.frame(self._pelvis)
        self.asked.append(dynamics.state.time)
        if self.target is None:
            self.target = float(frame.position[2])
        self.jacobian[:], self.drift[:] = frame.jacobian[2:3], frame.bias[2:3]
        self.error[:], self.error_rate[:] = self.target - frame.position[2], -frame.velocity[2]
        return np.zeros(1)

    def reset(self):
        self.target = None


def stack_of(robot):
    return Stack(
        contacts=[SurfaceContact(sole) for sole in robot.soles],
        levels=[
            [poise.ComTask(), Height(), FrameTask("pelvis", "orientation")],
            [FrameTask("left_hand"), FrameTask("right_hand")],
            [PostureTask()],
        ],
        torque_limit=poise.stack.TorqueLimit(rate=1000.0),
        self_collision_limit=SelfCollisionLimit(),
    )


def gentle(robot, k):
    """The k-th of some states near home, one after another."""
    home = RobotState(robot.q_home, np.zeros(robot.nv))
    near = near_home(robot, 3, spread=0.02, speed=0.0)
    part = np.sin(0.1 * k)
    q = home.q + part * (near.q - home.q)
    return RobotState(
        q / np.r_[np.ones(3), [np.linalg.norm(q[3:7])] * 4, np.ones(robot.nj)],
        np.zeros(robot.nv),
        time=0.002 * k,
    )


def run(controller, ticks):
    return [controller.step(gentle(controller.robot, k)) for k in ticks]


def joints_of(command):
    return command.velocity if command.torque is None else command.torque


def assert_equal(ours, theirs):
    assert [c.status for c in ours] == [c.status for c in theirs]
    for one, other in zip(ours, theirs, strict=True):
        scale = 1.0 + np.abs(joints_of(one)).max()
        assert np.abs(joints_of(one) - joints_of(other)).max() < EQUAL * scale


def lead(stack, *, cones=False):
    """Set what a leader sets before a tick: targets, gains, weights, speeds, contacts, limits."""
    hand, com = stack.task("left_hand pose"), stack.task("com")
    hand.set_target(position=hand.target_position + [0.03, 0.0, 0.02])
    com.set_gains(55.0, 11.0)
    com.set_weight(2.0)
    hand.set_speed([0.7, 1.1])
    stack.task("right_hand pose").set_acceleration([0.1, 0.0, 0.0, 0.0, 0.0, 0.2])
    stack.contact("left_sole").set_damping(13.0)
    stack.contact("right_sole").release(0.05)
    if cones:
        stack.contact("left_sole").carry_on((-0.04, -0.02), (0.08, 0.03))


@pytest.mark.parametrize("kind", KINDS)
def test_a_copy_goes_on_as_the_original_would(robot, kind, duplicate):
    controller = KINDS[kind](robot, stack_of(robot))
    run(controller, range(5))
    before = duplicate(controller)
    cones = kind != "osf"  # It reads them when it is made.
    lead(controller.stack, cones=cones)
    run(controller, range(5, 10))
    assert 0.0 < controller.stack.contact("right_sole").wrench_upper[2] < robot.weight
    after = duplicate(controller)
    # Targets that tasks took from the robot are kept, and what was set.
    np.testing.assert_array_equal(
        after.stack.task("com").target_position, controller.stack.task("com").target_position
    )
    assert after.stack.task("height").target == controller.stack.task("height").target
    assert after.stack.task("height").asked == controller.stack.task("height").asked
    # The foot is off the ground before the end.
    rest = range(10, 40)
    expected = run(controller, rest)
    assert all(command.status.ok for command in expected)
    assert not controller.stack.contact("right_sole").active
    assert_equal(run(after, rest), expected)
    # What was done to the original since did not reach the first copy, which can still do it.
    np.testing.assert_array_equal(before.stack.task("com").kp, 40.0)
    lead(before.stack, cones=cones)
    run(before, range(5, 10))
    assert_equal(run(before, rest), expected)


@pytest.mark.parametrize("kind", ["whole_body", "osf", "differential_ik"])
def test_a_change_of_the_copy_leaves_the_original_alone(robot, kind, duplicate):
    one, other = (KINDS[kind](robot, stack_of(robot)) for _ in range(2))
    run(one, range(5)), run(other, range(5))
    twin = duplicate(one)
    lead(twin.stack)
    changed = run(twin, range(5, 10))
    expected = run(other, range(5, 10))
    assert_equal(run(one, range(5, 10)), expected)
    assert np.abs(joints_of(changed[-1]) - joints_of(expected[-1])).max() > 1e-2


def test_a_copy_falls_back_from_the_last_command(robot, duplicate):
    controller = poise.WholeBodyController(robot)
    run(controller, range(3))
    twin = duplicate(controller)
    bad = RobotState(np.full(robot.nq, np.nan), np.zeros(robot.nv), time=0.01)
    ours, theirs = controller.step(bad), twin.step(bad)
    assert ours.status is theirs.status is CommandStatus.BAD_STATE
    assert np.abs(ours.torque).max() > 1.0
    np.testing.assert_array_equal(theirs.torque, ours.torque)
    assert duplicate(twin).status().reason == twin.status().reason != ""


def test_settings_of_a_controller_are_kept(robot, duplicate):
    stack = stack_of(robot)
    osf = poise.OperationalSpaceController(robot, stack, torque_step=7.0)
    squeeze = [0.0, 40.0, 300.0, 0.0, 0.0, 0.0]
    osf.set_wrench("left_sole", squeeze)
    osf.set_levels(stack.levels[:2])
    osf.fall_height_ratio = 0.4
    run(osf, range(3))
    twin = duplicate(osf)
    assert [t.name for _, t in twin.stack.tasks()] == [t.name for _, t in osf.stack.tasks()]
    assert twin.fall_height_ratio == 0.4
    np.testing.assert_array_equal(twin.strategy.forces.reference[:6], squeeze)
    assert_equal(run(twin, range(3, 8)), run(osf, range(3, 8)))
    ik = poise.DifferentialIK(robot, dt=2e-3)
    ik.set_stance("right_sole")
    run(ik, range(3))
    twin = duplicate(ik)
    assert twin.dt == ik.dt
    run(twin, [3])
    assert twin.stance is twin.stack.contact("right_sole")


def test_what_is_copied_together_stays_together(robot, duplicate):
    controller = poise.WholeBodyController(robot)
    hand = controller.stack.task("left_hand pose")
    twin, its_hand, its_stack = duplicate((controller, hand, controller.stack))
    assert its_stack is twin.stack
    assert its_hand is twin.stack.task("left_hand pose")
    assert its_hand is not hand
    assert its_hand.robot is twin.robot


class Own(poise.WholeBodyController):
    """A user's controller, which makes its own stack."""

    def __init__(self, robot, kp):
        super().__init__(robot, Stack(levels=[[poise.ComTask(kp=kp)], [PostureTask()]]))


def test_a_controller_of_ones_own_is_copied(get_robot, duplicate):
    robot = get_robot("upper17")
    controller = Own(robot, kp=30.0)
    state = RobotState(robot.q_home + 0.02, np.zeros(robot.nv))
    controller.step(state)
    controller.stack.task("com").set_target([0.1, 0.0, 0.4])
    twin = duplicate(controller)
    np.testing.assert_array_equal(twin.stack.task("com").kp, 30.0)
    assert_equal([twin.step(state)], [controller.step(state)])


def test_a_bound_stack_is_copied_with_what_was_set(robot, duplicate):
    stack = stack_of(robot)
    poise.WholeBodyController(robot, stack)
    lead_before = stack.task("com").kp.copy()
    stack.task("left_hand pose").set_target(position=[0.3, 0.2, 1.0])
    stack.joint_limit.leave_to_stop(2, at_lower=True, at_upper=False)
    its_robot, twin = duplicate((robot, stack))
    controller = poise.WholeBodyController(its_robot, twin)
    np.testing.assert_array_equal(twin.task("left_hand pose").target_position, [0.3, 0.2, 1.0])
    assert twin.joint_limit.viability.q_min[2] == -np.inf
    twin.joint_limit.leave_to_stop(2, at_lower=False, at_upper=False)
    assert np.isfinite(twin.joint_limit.viability.q_min[2])
    twin.task("com").set_gains(99.0)
    run(controller, range(2))
    np.testing.assert_array_equal(stack.task("com").kp, lead_before)
    assert np.isinf(stack.joint_limit.q_min[2])


def test_a_stack_that_serves_nobody_is_copied(robot, duplicate):
    stack = stack_of(robot)
    stack.task("com").set_gains(12.0)
    twin = duplicate(stack)
    poise.WholeBodyController(robot, twin)
    np.testing.assert_array_equal(twin.task("com").kp, 12.0)
    with pytest.raises(poise.PoiseError, match="serves no robot"):
        _ = stack.task("com").kp


@pytest.mark.parametrize("name", ["humanoid33", "g1", "arm6", "panda"])
def test_a_robot_is_pickled_whole_and_stays_read_only(get_robot, name):
    robot = get_robot(name)
    twin = pickled(robot)
    assert twin.model == robot.model
    assert repr(twin) == repr(robot)
    assert twin.source == robot.source
    assert twin.soles == robot.soles
    assert isinstance(twin.soles, MappingProxyType)
    for own, other in zip(robot.roles.values(), twin.roles.values(), strict=True):
        np.testing.assert_array_equal(other.rotation, own.rotation)
        assert not other.rotation.flags.writeable
    for array in ("q_min", "q_max", "v_max", "tau_max", "q_home"):
        np.testing.assert_array_equal(getattr(twin, array), getattr(robot, array))
        assert not getattr(twin, array).flags.writeable
    with pytest.raises(UnknownNameError):
        twin.frame_id("no such frame")
    # Nothing can be changed in it, so that what is bound to it fits its copy.
    assert copy.deepcopy(robot) is robot


def last_torque(controller, ticks):
    return run(controller, ticks)[-1].torque


@pytest.mark.slow
def test_a_controller_goes_on_in_another_process(robot):
    controller = poise.WholeBodyController(robot, stack_of(robot))
    run(controller, range(5))
    lead(controller.stack)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        theirs = pool.apply(last_torque, (controller, range(5, 10)))
    ours = last_torque(controller, range(5, 10))
    np.testing.assert_allclose(theirs, ours, rtol=0, atol=EQUAL * np.abs(ours).max())
