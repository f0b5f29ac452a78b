"""The balance limit in the controllers of torques."""

import numpy as np
import pytest
from oracles import near_home

from poise.control import (
    OperationalSpaceController,
    ReducedController,
    WholeBodyController,
)
from poise.dynamics import Dynamics
from poise.stack import BalanceLimit, ComTask, PostureTask, Stack, SurfaceContact, default_stack

CONTROLLERS = [WholeBodyController, ReducedController, OperationalSpaceController]
SEEDS = range(4)


def asked_away(robot, far, *, enabled=True):
    """The default stack with the CoM's target far ahead."""
    plain = default_stack(robot)
    limit = BalanceLimit(enabled=enabled)
    stack = Stack(plain.contacts, plain.levels, balance_limit=limit)
    stack.bind(robot)
    com = stack.task("com")
    com.set_speed(np.inf)
    com.set_target(Dynamics(robot).com + np.array([far, 0.0, 0.0]))
    return stack


def com_acceleration(stack, command):
    com = stack.task("com")
    return com.jacobian @ command.acceleration + com.drift


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
@pytest.mark.parametrize("make", CONTROLLERS)
def test_a_com_target_beyond_the_feet_is_followed_as_far_as_feet_catch(get_robot, make, name):
    robot = get_robot(name)
    state = near_home(robot, 0, spread=0.0, speed=0.0)
    stacks = [asked_away(robot, 0.3, enabled=enabled) for enabled in (False, True)]
    commands = [make(robot, stack).step(state) for stack in stacks]
    free, held = (com_acceleration(s, c)[0] for s, c in zip(stacks, commands, strict=True))
    assert all(command.status.ok for command in commands)
    assert [command.held_back for command in commands] == [False, True]
    # From rest the front edge, some 0.1 m ahead, may be approached by its distance a decay time.
    assert 0.2 < held < 2.0
    # The closed form lets go of what does not fit its cones, bounded or not.
    assert held < free or make is OperationalSpaceController


@pytest.mark.parametrize("make", CONTROLLERS)
def test_a_target_that_feet_can_hold_is_not_touched(get_robot, make):
    robot = get_robot("g1")
    state = near_home(robot, 1, spread=0.0, speed=0.0)
    answers = []
    for enabled in (False, True):
        stack = asked_away(robot, 0.002, enabled=enabled)
        answers.append(make(robot, stack).step(state))
    assert not answers[1].held_back
    scale = np.abs(answers[0].torque).max()
    assert np.abs(answers[1].torque - answers[0].torque).max() < 1e-9 * scale


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_reduced_controller_holds_back_as_the_whole_one_does(get_robot, name, seed):
    robot = get_robot(name)
    state = near_home(robot, seed, spread=0.02, speed=0.1)
    commands = [
        make(robot, asked_away(robot, 0.3)).step(state)
        for make in (WholeBodyController, ReducedController)
    ]
    whole, reduced = commands
    assert whole.held_back
    assert reduced.held_back
    scale = np.abs(whole.acceleration).max()
    assert np.abs(whole.acceleration - reduced.acceleration).max() < 1e-8 * scale
    assert len(whole.residuals) == len(reduced.residuals) == 2 + len(default_stack(robot).levels)


@pytest.mark.parametrize("strategy", ["direct", "cascade", "weighted"])
def test_every_strategy_keeps_the_rows(get_robot, strategy):
    robot = get_robot("g1")
    state = near_home(robot, 2, spread=0.01, speed=0.05)
    controller = WholeBodyController(robot, asked_away(robot, 0.4), strategy=strategy)
    command = controller.step(state)
    rows = controller.strategy.current.full.rows
    own = rows.balance_rows
    values = rows.J[own] @ command.acceleration
    assert (values <= rows.upper[own] + 1e-5).all()
    assert (values >= rows.target[own] - 1e-5).all()
    assert command.held_back or strategy == "weighted"


def test_the_status_says_what_is_cut_and_against_what(get_robot):
    robot = get_robot("humanoid33")
    controller = WholeBodyController(robot, asked_away(robot, 0.3))
    controller.step(near_home(robot, 0, spread=0.0, speed=0.0))
    status = controller.status()
    assert status.held_back
    assert "held back by the balance limit" in str(status)
    assert "balance limit: edge of the support" in status.explanation
    assert next(task for task in status.tasks if task.name == "com").residual > 1.0
    controller.reset()
    assert not controller.status().held_back


def test_levels_keep_their_numbers(get_robot):
    robot = get_robot("g1")
    stack = Stack([SurfaceContact(s) for s in robot.soles], [[ComTask()], [PostureTask()]])
    controller = WholeBodyController(robot, stack)
    command = controller.step(near_home(robot, 0, speed=0.0))
    assert len(command.residuals) == 4
    assert [task.level for task in controller.status().tasks] == [3, 4]
    many = controller.solve_batch([near_home(robot, 0, speed=0.0)] * 2)
    assert many.residuals.shape == (2, 4)
    assert np.allclose(many.torque[0], command.torque, atol=1e-7)


def test_switched_tasks_keep_the_limit_of_their_stack(get_robot):
    robot = get_robot("g1")
    stack = asked_away(robot, 0.3, enabled=False)
    controller = OperationalSpaceController(robot, stack)
    controller.set_levels([[ComTask()], [PostureTask()]])
    assert controller.stack.balance_limit is stack.balance_limit
