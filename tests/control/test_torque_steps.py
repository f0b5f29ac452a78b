"""The bound on the change of torque from tick to tick."""

import numpy as np
import pytest
from oracles import near_home

from poise.control import ReducedController, WholeBodyController
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.stack import Stack, TorqueLimit, default_stack

CONTROLLERS = [WholeBodyController, ReducedController]
PERIOD = 0.002


def stack_of(robot, rate):
    plain = default_stack(robot)
    stack = Stack(plain.contacts, plain.levels, torque_limit=TorqueLimit(rate=rate), softening=0.0)
    stack.bind(robot)
    return stack


def at(robot, time):
    return RobotState(robot.q_home, np.zeros(robot.nv), time=time)


def jump(robot, stack):
    """A hand is asked for a thing that takes other torques at once."""
    hand = next(task for _, task in stack.tasks() if task.name.startswith(robot.hands[0]))
    hand.set_acceleration(np.full(hand.dim, 30.0))


@pytest.mark.parametrize("make", CONTROLLERS)
def test_torques_go_to_new_ones_no_faster_than_the_rate(get_robot, make):
    robot = get_robot("g1")
    answers = {}
    for rate in (None, 50.0):
        stack = stack_of(robot, rate)
        controller = make(robot, stack)
        first = controller.step(at(robot, 0.0)).torque
        jump(robot, stack)
        commands = [controller.step(at(robot, (1 + i) * PERIOD)) for i in range(40)]
        answers[rate] = [first, *(c.torque for c in commands)]
        assert all(c.status.ok and c.residuals[0] < 1e-9 for c in commands)
    # Far faster without the bound; with it as fast as it allows, and to the same torques.
    assert (np.abs(answers[None][1] - answers[None][0]) / robot.tau_max).max() > 0.2
    steps = np.abs(np.diff(answers[50.0], axis=0)) / robot.tau_max
    assert steps.max() <= 50.0 * PERIOD + 1e-7
    assert steps[0].max() >= 50.0 * PERIOD - 1e-7
    assert np.abs(answers[50.0][-1] - answers[None][-1]).max() < 1e-6 * robot.tau_max.max()


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize("make", CONTROLLERS)
@pytest.mark.parametrize("seed", range(6))
def test_no_torque_jumps_whatever_the_state_asks_for(get_robot, make, seed):
    """The equations of motion hold all the same; contacts and balance come to what they need."""
    robot = get_robot("g1")
    controller = make(robot, stack_of(robot, 5.0))
    last = controller.step(at(robot, 0.0)).torque
    for tick in range(1, 200):
        state = near_home(robot, seed, spread=0.03, speed=0.3, time=tick * PERIOD)
        command = controller.step(state)
        assert command.status.ok
        assert command.residuals[0] < 1e-9
        assert (np.abs(command.torque - last) / robot.tau_max).max() <= 5.0 * PERIOD + 1e-7
        last = command.torque
    free = make(robot, stack_of(robot, None))
    free.step(at(robot, 0.0))
    wanted = free.step(state).residuals
    assert np.allclose(command.residuals[:3], wanted[:3], atol=1e-6)


def test_the_status_says_which_torque_holds_a_task_back(get_robot):
    robot = get_robot("g1")
    stack = stack_of(robot, 1.0)
    controller = WholeBodyController(robot, stack)
    controller.step(at(robot, 0.0))
    jump(robot, stack)
    command = controller.step(at(robot, PERIOD))
    assert "torque limit of" in controller.status().explanation
    assert len(command.residuals) == 2 + len(stack.levels)


def test_a_reset_frees_the_next_command_and_many_states_know_no_last_one(get_robot):
    robot = get_robot("g1")
    stack = stack_of(robot, 1.0)
    controller = WholeBodyController(robot, stack)
    controller.step(at(robot, 0.0))
    jump(robot, stack)
    free = WholeBodyController(robot, (other := stack_of(robot, None)))
    other_first = free.step(at(robot, 0.0))
    jump(robot, other)
    wanted = free.step(at(robot, PERIOD)).torque
    assert other_first.status.ok
    batch = controller.solve_batch([at(robot, PERIOD)])
    assert np.abs(batch.torque[0] - wanted).max() < 1e-6
    assert np.abs(controller.step(at(robot, PERIOD)).torque - wanted).max() > 1e-2
    controller.reset()
    assert np.abs(controller.step(at(robot, PERIOD)).torque - wanted).max() < 1e-6


@pytest.mark.parametrize("times", [(0.0, 0.0), (5.0, 1.0), (0.0, 50.0)])
def test_a_clock_that_stands_or_jumps_gives_a_tick_of_a_usual_length(get_robot, times):
    robot = get_robot("g1")
    stack = stack_of(robot, 10.0)
    controller = WholeBodyController(robot, stack)
    last = controller.step(at(robot, times[0])).torque
    jump(robot, stack)
    step = np.abs(controller.step(at(robot, times[1])).torque - last) / robot.tau_max
    assert 10.0 * 1e-3 - 1e-7 <= step.max() <= 10.0 * 0.02 + 1e-7


def test_after_a_tick_without_an_answer_the_next_is_free(get_robot):
    robot = get_robot("g1")
    stack = stack_of(robot, 0.1)
    controller = WholeBodyController(robot, stack)
    controller.step(at(robot, 0.0))
    bad = controller.step(RobotState(np.full(robot.nq, np.nan), np.zeros(robot.nv), time=PERIOD))
    jump(robot, stack)
    good = controller.step(at(robot, 2 * PERIOD))
    assert not bad.status.ok
    wanted = WholeBodyController(robot, (free := stack_of(robot, None)))
    wanted.step(at(robot, 0.0))
    jump(robot, free)
    assert np.abs(good.torque - wanted.step(at(robot, 2 * PERIOD)).torque).max() < 1e-6


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_rates_that_cannot_be_are_refused(rate):
    with pytest.raises(ConfigurationError, match="rate of the torque limit"):
        TorqueLimit(rate=rate)


def test_a_rate_costs_no_rows(get_robot):
    robot = get_robot("g1")
    sizes = [
        WholeBodyController(robot, stack_of(robot, rate)).strategy.current.size
        for rate in (None, 50.0)
    ]
    assert sizes[0] == sizes[1]
