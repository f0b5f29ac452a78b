"""Joints keep their bounds, and tasks have what these leave."""

import math

import numpy as np
import pytest
from oracles import near_home
from osf_world import missing

from poise.control import OperationalSpaceController
from poise.sim import Plant
from poise.stack import (
    ComTask,
    FrameTask,
    JointLimit,
    JointTask,
    PostureTask,
    Stack,
    SurfaceContact,
)


@pytest.mark.parametrize(
    ("name", "joint"), [("panda", "panda_joint4"), ("humanoid33", "left_elbow")]
)
def test_a_joint_driven_into_its_limit_stops_before_it(get_any, name, joint):
    """A target half a radian beyond the limit, in simulation."""
    robot = get_any(name)
    index = robot.joint_index(joint)
    task = JointTask([joint], kp=100.0)
    contacts = [SurfaceContact(sole) for sole in robot.soles]
    levels = [[task], [PostureTask()]]
    if contacts:
        levels.insert(0, [ComTask(), FrameTask(robot.pelvis, "orientation")])
    stack = Stack(contacts, levels)
    controller, plant = OperationalSpaceController(robot, stack), Plant(robot)
    task.set_target([robot.q_min[index] - 0.5])
    angles, held = [], 0
    while plant.time < 1.0:
        state = plant.state()
        command = controller.step(state)
        assert command.status.ok
        acceleration, limit = command.acceleration[robot.base_dofs :], stack.joint_limit
        assert (acceleration >= limit.lower - 1e-5).all()
        assert (acceleration <= limit.upper + 1e-5).all()
        held += joint in controller.status().explanation
        angles.append(state.q[robot.nq - robot.nj + index])
        plant.step(command)
    assert held > 100
    assert not plant.fallen
    assert min(angles) > robot.q_min[index]
    # The limit's own margin, and not much more.
    assert angles[-1] < robot.q_min[index] + 0.03


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("name", ["arm6", "panda", "upper17", "humanoid33"])
def test_accelerations_keep_to_the_bounds_or_the_command_says_by_how_much_not(get_any, name):
    """Many joints at tight bounds at once. A fixed base can always keep them."""
    robot, kept = get_any(name), 0
    for seed in range(20):
        hand = FrameTask(robot.hands[0], "position", kp=400.0)
        stack = Stack(
            contacts=[SurfaceContact(sole) for sole in robot.soles],
            levels=[[hand], [PostureTask(kp=200.0)]],
            joint_limit=JointLimit(acceleration_max=30.0),
        )
        controller = OperationalSpaceController(robot, stack, torque_step=math.inf)
        state = near_home(robot, seed, spread=0.2, speed=0.2)
        command = controller.step(state)
        assert command.status.ok
        limit, acceleration = stack.joint_limit, command.acceleration[robot.base_dofs :]
        outside = np.maximum(acceleration - limit.upper, limit.lower - acceleration).max()
        kept += outside < 1e-5
        said = "bounds" in controller.status().explanation
        assert said == (outside > 1e-6 * limit.acceleration_max)
        assert command.residuals[1] >= outside / limit.acceleration_max - 1e-9
    # Contacts stand above joint limits, and torque limits beside them: a humanoid may not.
    assert kept == 20 or robot.floating_base
    assert kept >= 8


def test_a_joint_at_its_bound_leaves_the_tasks_the_rest(get_any):
    """A redundant arm still meets its hand with one joint held."""
    robot = get_any("panda")
    hand = FrameTask(robot.hands[0], "position")
    stack = Stack(levels=[[hand], [JointTask(["panda_joint1"])], [PostureTask()]])
    controller = OperationalSpaceController(robot, stack, torque_step=math.inf)
    state = near_home(robot, 0, spread=0.02, speed=0.0)
    hand.set_acceleration([0.5, 0.2, 0.1])
    stack.task("joints").set_acceleration([1e3])
    command = controller.step(state)
    assert np.abs(command.acceleration[0]) <= 200.0 + 1e-6
    assert np.abs(missing(hand, command.acceleration)).max() < 1e-6
