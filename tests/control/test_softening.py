"""Stacks whose levels cannot be met: controllers come to rest, and say so."""

import numpy as np
import pytest
from oracles import near_home

from poise.control import (
    DifferentialIK,
    ReducedController,
    WholeBodyController,
)
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.hqp import make_solver
from poise.sim import Plant, PlantConfig, rollout
from poise.stack import FrameTask, JointTask, PostureTask, Stack, TorqueLimit, default_stack

ARM_PERIOD = 1e-3


def stack_of(robot, **changes):
    plain = default_stack(robot)
    changes.setdefault("torque_limit", plain.torque_limit)
    return Stack(plain.contacts, plain.levels, **changes)


def make(kind, robot, stack):
    if kind is DifferentialIK:
        return DifferentialIK(robot, stack, dt=ARM_PERIOD, strategy="hqp")
    return kind(robot, stack)


def led_away(kind, robot, stack, way, seconds=2.2):
    """Move the hand's target within a second; step and joint speed of the last half second."""
    velocities = kind is DifferentialIK
    controller = make(kind, robot, stack)
    config = PlantConfig(control_dt=ARM_PERIOD, actuation="velocity" if velocities else "torque")
    hand, plant, start = stack.task(f"{robot.hands[0]} pose"), Plant(robot, config), []

    def lead(state):
        if not start:
            controller.step(state)
            start.append(hand.target_position)
        hand.set_target(start[0] + min(1.0, state.time) * np.asarray(way))

    commands, speeds = [], []
    for tick in rollout(plant, controller, lead, duration=seconds):
        assert tick.command.status.ok
        command = tick.command.velocity if velocities else tick.command.torque
        commands.append(command.copy())
        speeds.append(np.abs(tick.truth.v[-robot.nj :]).max())
    last = round(0.5 / ARM_PERIOD)
    limit = robot.v_max if velocities else robot.tau_max
    steps = np.abs(np.diff(commands[-last:], axis=0)) / limit
    return steps.max(), max(speeds[-last:]), controller


@pytest.mark.parametrize("kind", [WholeBodyController, ReducedController, DifferentialIK])
def test_a_hand_out_of_reach_comes_to_rest_and_is_named(get_robot, kind):
    robot = get_robot("panda")
    step, speed, controller = led_away(kind, robot, stack_of(robot), (1.0, 0.0, 0.0))
    assert step < 0.02
    assert speed < 0.1
    status = controller.status()
    error = status.tasks[0].error
    assert status.softened == {3: pytest.approx(error * np.sqrt(0.05 / (0.05 + error)))}
    assert "level 3 softened by 0.1" in str(status)
    assert "level 3 is softened" in status.explanation


def test_it_comes_to_rest_by_the_solver_and_not_by_a_bound_on_torque_steps(get_robot):
    robot = get_robot("panda")
    stack = stack_of(robot, torque_limit=TorqueLimit(rate=None))
    step, speed, _ = led_away(WholeBodyController, robot, stack, (1.0, 0.0, 0.0))
    assert step < 0.02
    assert speed < 0.1


def test_strict_levels_shake_there(get_robot):
    robot = get_robot("panda")
    stack = stack_of(robot, softening=0.0)
    step, _, controller = led_away(WholeBodyController, robot, stack, (1.0, 0.0, 0.0))
    assert step > 0.1
    assert controller.status().softened == {}


def test_a_target_in_reach_is_met_exactly_and_ends_strict(get_robot):
    robot = get_robot("panda")
    _, speed, controller = led_away(
        WholeBodyController, robot, stack_of(robot), (0.05, 0.05, -0.1), seconds=3.5
    )
    assert speed < 1e-4
    assert controller.status().softened == {}
    assert controller.status().tasks[0].error < 1e-6


@pytest.mark.parametrize("softening", [-0.1, np.nan, np.inf])
def test_a_softening_that_is_no_number_is_refused_by_name(get_robot, softening):
    with pytest.raises(ConfigurationError, match="softening of the stack") as refused:
        stack_of(get_robot("panda"), softening=softening)
    assert refused.value.wanted == "a finite number >= 0"


def test_without_softening_the_answer_is_that_of_the_problem_bit_for_bit(get_robot):
    robot = get_robot("humanoid33")
    stack = stack_of(robot, softening=0.0)
    controller = WholeBodyController(robot, stack)
    stack.task("com").set_target([0.3, 0.2, 0.7])
    for seed in range(4):
        controller.reset()
        command = controller.step(near_home(robot, seed))
        alone = make_solver()
        x = alone.solve(controller.strategy.current.full.problem).x
        assert command.acceleration.tobytes() == x[: robot.nv].tobytes()


def test_the_reduced_controller_softens_as_the_whole_one(get_robot):
    robot = get_robot("humanoid33")
    found = []
    for kind in (WholeBodyController, ReducedController):
        controller = kind(robot, stack_of(robot))
        controller.stack.task("com").set_target([0.1, 0.1, 0.7])
        controller.stack.task("left_hand pose").set_target(position=[1.0, 0.5, 1.0])
        answers = []
        for seed in range(4):
            controller.reset()
            answers.append(controller.step(near_home(robot, seed)).torque)
        assert set(controller.status().softened) == {3, 4}
        found.append(answers)
    np.testing.assert_allclose(found[0], found[1], atol=1e-5)


def test_many_states_are_softened_as_single_ones(get_robot):
    robot = get_robot("humanoid33")
    controller = WholeBodyController(robot, stack_of(robot, torque_limit=TorqueLimit()))
    controller.stack.task("left_hand pose").set_target(position=[1.0, 0.5, 1.0])
    states = [near_home(robot, seed) for seed in range(5)]
    batch = controller.solve_batch(states, threads=1)
    for torque, state in zip(batch.torque, states, strict=True):
        controller.reset()
        single = controller.step(state)
        assert controller.status().softened
        np.testing.assert_allclose(torque, single.torque, atol=1e-6)


def test_joints_without_a_joint_task_are_damped(get_robot):
    """No posture below: a hand out of reach rests, and the elbow does not drift."""
    robot = get_robot("panda")
    stack = Stack(levels=[[FrameTask(robot.hands[0])]])
    step, speed, controller = led_away(WholeBodyController, robot, stack, (1.0, 0.0, 0.0))
    assert step < 0.02
    assert speed < 0.1
    assert set(controller.status().softened) == {3}


def test_a_level_that_refers_to_all_joints_is_never_softened(get_robot):
    robot = get_robot("panda")
    hand, posture = FrameTask(robot.hands[0]), PostureTask()
    controller = WholeBodyController(robot, Stack(levels=[[hand, posture]]))
    hand.set_target(position=[3.0, 0.0, 0.0])
    controller.step(RobotState(robot.q_home, np.zeros(robot.nv)))
    assert controller.status().softened == {}
    halves = [JointTask(robot.joint_names[k::2], name=f"half {k}") for k in range(2)]
    controller = WholeBodyController(robot, Stack(levels=[[FrameTask(robot.hands[0]), *halves]]))
    controller.step(RobotState(robot.q_home, np.zeros(robot.nv)))
    assert controller.status().softened == {}


@pytest.mark.parametrize("far", [1e3, 1e100])
def test_an_absurd_target_gives_a_status_and_no_jump(get_robot, far):
    robot = get_robot("panda")
    stack = stack_of(robot)
    controller, state = WholeBodyController(robot, stack), RobotState(robot.q_home, np.zeros(7))
    last = controller.step(state).torque
    stack.task("hand pose").set_target(position=[far, 0.0, 0.0])
    for tick in range(1, 20):
        command = controller.step(RobotState(robot.q_home, np.zeros(7), time=1e-3 * tick))
        assert np.isfinite(command.torque).all()
        assert np.abs((command.torque - last) / robot.tau_max).max() < 0.26
        last = command.torque
