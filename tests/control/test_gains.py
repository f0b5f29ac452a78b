"""Gains that are set while a controller runs: its next tick is that of one made with them."""

import numpy as np
import pytest
from oracles import near_home

import poise
from poise.control import CommandStatus
from poise.errors import ConfigurationError, UnknownNameError
from poise.stack import (
    ComTask,
    FrameTask,
    MomentumTask,
    PostureTask,
    Stack,
    SurfaceContact,
    Task,
)

CONTROLLERS = {
    "whole_body": poise.WholeBodyController,
    "reduced": poise.ReducedController,
    "osf": poise.OperationalSpaceController,
    "differential_ik": lambda robot, stack: poise.DifferentialIK(robot, stack, dt=2e-3),
    "exact differential_ik": lambda robot, stack: poise.DifferentialIK(
        robot, stack, dt=2e-3, strategy="hqp"
    ),
}
BEFORE = {"com": (30.0, None), "hand": (60.0, None), "own": (10.0, None), "posture": (20.0, None)}
AFTER = {
    "com": (50.0, None),
    "hand": ([80.0, 90.0, 100.0], [15.0, 16.0, 17.0]),
    "own": (35.0, 9.0),
    "posture": (70.0, 11.0),
}
"""kp and kd by task; of critical damping and not, one number and one a row."""


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


class HeightTask(Task):
    """The height of the base, in Python."""

    def __init__(self, *, kp, kd):
        super().__init__("own", kp=kp, kd=kd, weight=1.0)

    def _resolve(self, robot):
        self._base = robot.frame_id(robot.torso)
        return 1

    def _evaluate(self, dynamics):
        frame = dynamics.frame(self._base)
        self.jacobian, self.drift = frame.jacobian[2:3], frame.bias[2:3]
        self.error, self.error_rate = np.array([0.02]), -frame.velocity[2:3]
        return np.zeros(1)


def make_stack(robot, gains, *, damping, momentum):
    def of(name):
        kp, kd = gains[name]
        return {"kp": kp, "kd": kd}

    com, hand = ComTask(**of("com")), FrameTask("left_hand", "position", name="hand", **of("hand"))
    com.set_target(near_home_com(robot))
    hand.set_target([0.3, 0.3, 1.0])
    turning = MomentumTask(kd=momentum)
    return Stack(
        [SurfaceContact(sole, damping=damping) for sole in robot.soles],
        [[com], [hand, turning], [HeightTask(**of("own"))], [PostureTask(**of("posture"))]],
    )


def near_home_com(robot):
    dynamics = poise.Dynamics(robot)
    return dynamics.com + [0.01, 0.02, -0.01]


def set_all(stack):
    for name, (kp, kd) in AFTER.items():
        stack.task(name).set_gains(kp, kd)
    stack.task("angular momentum").set_gains(kd=8.0)
    for contact in stack.contacts:
        contact.set_damping(35.0)


def joints_of(command):
    assert command.status is CommandStatus.OK
    return command.velocity if command.torque is None else command.torque


@pytest.mark.parametrize("name", CONTROLLERS)
def test_the_next_tick_is_that_of_a_controller_made_with_these_gains(robot, name):
    make, first, second = CONTROLLERS[name], near_home(robot, 0), near_home(robot, 1)
    before = {"damping": 20.0, "momentum": 5.0}
    made = make(robot, make_stack(robot, AFTER, damping=35.0, momentum=8.0))
    expected = joints_of(made.step(second)).copy()

    running = make(robot, make_stack(robot, BEFORE, **before))
    joints_of(running.step(first))
    running.reset()  # some go on from their last answer, which is another here
    apart = np.abs(joints_of(running.step(second)) - expected).max()
    running.reset()
    set_all(running.stack)
    scale = np.abs(expected).max()
    assert apart > 1e-3 * scale
    assert np.abs(joints_of(running.step(second)) - expected).max() < 1e-9 * scale

    early = make_stack(robot, BEFORE, **before)
    set_all(early)
    assert np.abs(joints_of(make(robot, early).step(second)) - expected).max() < 1e-9 * scale


@pytest.mark.parametrize("strategy", ["closed_form", "hqp"])
def test_velocities_without_damping_to_divide_by_fall_back_until_there_is_some(robot, strategy):
    """A task that follows kp / kd cannot without kd; nothing raises in the loop."""
    stack = make_stack(robot, BEFORE, damping=20.0, momentum=5.0)
    controller = poise.DifferentialIK(robot, stack, dt=2e-3, strategy=strategy)
    state = near_home(robot, 0)
    joints_of(controller.step(state))
    stack.task("posture").set_gains(20.0, 0.0)
    command = controller.step(state)
    assert command.status is CommandStatus.SOLVER_FAILED
    assert np.isfinite(command.velocity).all()
    stack.task("posture").set_gains(20.0)
    joints_of(controller.step(state))


def test_gains_are_set_by_the_tasks_name_through_the_controller(robot):
    controller = poise.WholeBodyController(
        robot, make_stack(robot, BEFORE, damping=20.0, momentum=5.0)
    )
    com = controller.stack.task("com")
    controller.set_gains("com", 64.0)
    np.testing.assert_array_equal((com.kp, com.kd), np.full((2, 3), [[64.0], [16.0]]))
    controller.set_gains("com", kd=3.0)
    np.testing.assert_array_equal((com.kp, com.kd), np.full((2, 3), [[64.0], [3.0]]))
    # Critical again unless told otherwise, whatever it was.
    controller.set_gains("com")
    np.testing.assert_array_equal(com.kd, np.full(3, 16.0))
    controller.set_gains("angular momentum", kd=7.0)
    with pytest.raises(UnknownNameError, match="choices.*com"):
        controller.set_gains("comm", 1.0)
    for kp, kd in ((-1.0, None), (np.nan, None), ([1.0, 2.0], None), (1.0, -1.0)):
        with pytest.raises(ConfigurationError, match="of task 'com'"):
            controller.set_gains("com", kp, kd)
    np.testing.assert_array_equal((com.kp, com.kd), np.full((2, 3), [[64.0], [16.0]]))


@pytest.mark.parametrize("name", ["differential_ik", "exact differential_ik"])
def test_who_commands_velocities_takes_no_stiffness_without_damping(robot, name):
    hand = FrameTask("left_hand", "position", name="hand", kp=60.0)
    stack = Stack([SurfaceContact(sole) for sole in robot.soles], [[hand], [PostureTask()]])
    controller = CONTROLLERS[name](robot, stack)
    before = hand.kp.copy(), hand.kd.copy()
    with pytest.raises(ConfigurationError, match="has no damping"):
        controller.set_gains("hand", 100.0, 0.0)
    np.testing.assert_array_equal(hand.kp, before[0])
    np.testing.assert_array_equal(hand.kd, before[1])


def test_gains_and_postures_that_were_given_are_kept(robot):
    gains, posture = np.full(3, 60.0), robot.q_home[7:].copy()
    hand = FrameTask("left_hand", "position", name="hand", kp=gains)
    rest = PostureTask(posture)
    gains[:], posture[:] = 1e4, 0.3
    poise.WholeBodyController(
        robot, Stack([SurfaceContact(sole) for sole in robot.soles], [[hand], [rest]])
    )
    np.testing.assert_array_equal(hand.kp, np.full(3, 60.0))
    np.testing.assert_array_equal(rest.target_position, robot.q_home[7:])


@pytest.mark.parametrize("value", [10**400, [10**400, 0, 0]], ids=["a number", "a row"])
def test_numbers_that_no_float_holds_are_refused(robot, value):
    hand = FrameTask("left_hand", "position")
    hand.bind(robot)
    with pytest.raises(ConfigurationError, match="not made of numbers"):
        hand.set_gains(value)
