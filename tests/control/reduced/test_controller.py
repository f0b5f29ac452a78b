"""The controller beside the whole-body controller, tick by tick, where the reduction is odd."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from oracles import near_home
from stances import relative, stances

from poise.control import ReducedController, WholeBodyController
from poise.dynamics import RobotState
from poise.stack import (
    ComTask,
    FrameTask,
    JointLimit,
    PointContact,
    PostureTask,
    RelativeFrameTask,
    Stack,
    SurfaceContact,
)

SAME = 1e-6
"""What two exact resolutions of one hierarchy with levels that give may differ by."""

PHYSICS = 1e-6


def contacts_of(robot, frames):
    return [SurfaceContact(f) if f in robot.soles else PointContact(f) for f in frames]


def balance(robot):
    return [ComTask(kp=40.0), FrameTask(robot.pelvis, "orientation")]


def both(robot, frames, levels, joint_limit=None):
    """The two controllers, each with a stack of its own."""
    return [
        kind(
            robot,
            Stack(
                contacts_of(robot, frames),
                levels(robot),
                joint_limit=None if joint_limit is None else JointLimit(**joint_limit),
            ),
        )
        for kind in (WholeBodyController, ReducedController)
    ]


def compare(commands, tolerance=SAME):
    whole, reduced = commands
    assert whole.status.ok
    assert reduced.status.ok
    assert relative(reduced.torque, whole.torque) < tolerance
    assert relative(reduced.acceleration, whole.acceleration) < tolerance
    assert set(reduced.wrenches) == set(whole.wrenches)
    for name, wrench in whole.wrenches.items():
        assert np.abs(reduced.wrenches[name] - wrench).max() < tolerance * robot_weight(whole)
    assert np.abs(np.subtract(reduced.residuals, whole.residuals)).max() < tolerance


def robot_weight(command):
    return max(1.0, *(float(np.abs(w).max()) for w in command.wrenches.values()))


def with_posture(robot):
    return [balance(robot), [FrameTask(h) for h in robot.hands], [PostureTask()]]


def test_contacts_that_change_every_tick_are_followed(get_robot):
    robot = get_robot("humanoid33")
    controllers = both(robot, robot.soles, with_posture)
    for tick in range(12):
        state = near_home(robot, tick, spread=0.03, speed=0.05, time=0.01 * tick)
        commands = []
        for controller in controllers:
            foot = controller.stack.contacts[tick % 2]
            (foot.release if foot.active and tick % 4 < 2 else foot.engage)(0.0)
            for _, task in controller.stack.tasks():
                task.reset()
            commands.append(controller.step(state))
        compare(commands, 1e-5)


def test_in_flight_only_the_base_is_left(get_robot):
    robot = get_robot("humanoid33")
    controllers = both(
        robot, (), lambda robot: [[FrameTask(h, "position") for h in robot.hands], [PostureTask()]]
    )
    state = near_home(robot, 0, spread=0.05, speed=0.05)
    commands = [c.step(state) for c in controllers]
    reduced = controllers[1].strategy.current.reduced.partition
    assert (reduced.na, reduced.constraint, len(reduced.chains)) == (6, (), 1)
    compare(commands)


@pytest.mark.parametrize("stance", ["everything", "hand contact"])
def test_where_every_joint_is_constrained_or_kept_the_problem_is_the_whole_one(get_robot, stance):
    robot = get_robot("biped20" if stance == "everything" else "humanoid33")
    frames = stances(robot)["everything"]
    controllers = both(robot, frames, lambda robot: [[PostureTask()]])
    state = near_home(robot, 1, spread=0.02, speed=0.02)
    commands = [c.step(state) for c in controllers]
    assert controllers[1].strategy.current.reduced.partition.nu == 0
    assert controllers[1].strategy.current.second is None
    compare(commands, 1e-5)


def test_a_task_between_frames_of_both_chains_is_exact(get_robot):
    robot = get_robot("humanoid33")

    def levels(robot):
        return [balance(robot), [RelativeFrameTask("left_hand", "left_sole")]]

    for frames in (robot.soles, list(robot.soles)[1:]):
        controllers = both(robot, frames, levels)
        compare([c.step(near_home(robot, 2, spread=0.05, speed=0.05)) for c in controllers])


def test_a_chain_that_its_limits_lock_keeps_them(get_robot):
    """Every joint of the upper body stands still and may not accelerate; the hands should."""
    robot = get_robot("humanoid33")
    controllers = both(robot, robot.soles, with_posture, joint_limit={"velocity_scale": 1e-9})
    for controller in controllers:
        for name in robot.hands:
            task = controller.stack.task(f"{name} pose")
            task.set_target(position=[1.0, 0.0, 2.0])
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    whole, reduced = (c.step(state) for c in controllers)
    assert controllers[1].strategy.current.second_solution is not None
    for command in (whole, reduced):
        assert command.status.ok
        assert max(command.residuals[:2]) < PHYSICS
        assert np.abs(command.acceleration[6:]).max() < 1e-3
    assert "joint limit" in controllers[1].status().explanation


def test_a_branch_without_inertia_falls_back_and_raises_nothing(get_robot):
    robot = get_robot("humanoid33")
    model = robot.model.copy()
    for joint in range(1, model.njoints):
        if model.names[joint].startswith(("right_shoulder", "right_elbow", "right_wrist")):
            model.inertias[joint] = pin.Inertia.Zero()
            rotors = model.armature.copy()
            rotors[model.idx_vs[joint]] = 0.0
            model.armature = rotors
    robot = dataclasses.replace(robot, model=model)
    controller = ReducedController(robot, Stack(contacts_of(robot, robot.soles), [balance(robot)]))
    command = controller.step(near_home(robot, 0))
    assert not command.status.ok
    assert np.isfinite(command.torque).all()
    assert str(controller.status())


def test_a_massless_branch_with_rotors_is_solved(get_robot):
    robot = get_robot("humanoid33")
    model = robot.model.copy()
    for joint in range(1, model.njoints):
        if model.names[joint].startswith("right_wrist"):
            model.inertias[joint] = pin.Inertia.Zero()
    robot = dataclasses.replace(robot, model=model)
    controllers = both(robot, robot.soles, with_posture)
    compare([c.step(near_home(robot, 0, spread=0.05, speed=0.05)) for c in controllers], 1e-5)


def test_status_names_tasks_of_both_chains_with_what_they_miss(get_robot):
    robot = get_robot("humanoid33")
    controllers = both(robot, robot.soles, with_posture)
    texts = []
    for controller in controllers:
        controller.stack.task("left_hand pose").set_target(position=[4.0, 0.0, 3.0])
        controller.step(near_home(robot, 0))
        texts.append([(t.name, t.level, round(t.residual, 3)) for t in controller.status().tasks])
    assert texts[0] == texts[1]


def test_sizes_are_those_of_the_small_problem(get_robot):
    robot = get_robot("humanoid33")
    whole, reduced = both(robot, robot.soles, lambda robot: [balance(robot)])
    for controller in (whole, reduced):
        controller.step(near_home(robot, 0))
    assert whole.size[0] == 39 + 12
    assert reduced.size[0] == 18 + 6 + 12
    assert reduced.size[1] < whole.size[1]


def test_lqp_1_does_not_grow_with_the_joints_of_the_free_chain(get_robot):
    """A posture of all joints leaves as many rows as the body and the centroids have unknowns."""
    sizes = []
    for name in ("humanoid33", "humanoid45"):
        robot = get_robot(name)
        controller = ReducedController(robot)
        assert controller.step(near_home(robot, 0, spread=0.02, speed=0.02)).status.ok
        sizes.append(controller.strategy.current.first.problem.size)
    assert sizes[0] == sizes[1]
