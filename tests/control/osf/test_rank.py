"""Tasks that cannot be met: lower levels never disturb higher ones, and torques stay bounded."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from oracles import near_home, random_state
from osf_world import (
    FLOATING,
    Rows,
    dense_acceleration,
    dense_recursion,
    missing,
    random_references,
    redundant_stacks,
    relative,
    stack_for,
)

from poise.control import OperationalSpaceController, RankTreatment
from poise.control._osf._recursion import OperationalRecursion
from poise.dynamics import RobotState
from poise.stack import (
    FrameTask,
    PostureTask,
    Stack,
)

SEEDS = range(10)

CLEAR = RankTreatment(low=1e-3, high=1e-2)
"""Below what the chosen states have, above what rounding leaves of a lost direction."""


@pytest.mark.parametrize("name", ["panda", "upper17", "humanoid33"])
@pytest.mark.parametrize("case", range(4))
def test_lost_ranks_give_what_a_pseudo_inverse_gives(get_any, name, case):
    robot = get_any(name)
    stack, met = list(redundant_stacks(robot).values())[case]
    world, rng = Rows(robot, stack), np.random.default_rng(case)
    for seed in SEEDS:
        random_references(stack, rng)
        rows = world.at(near_home(robot, seed, spread=0.05, speed=0.3))
        S, N = dense_recursion(rows, world.dynamics)
        wanted = S - N @ np.linalg.solve(world.dynamics.M, world.dynamics.h)
        found = OperationalRecursion(robot, CLEAR).resolve(rows, world.dynamics)
        assert np.abs(found - wanted).max() < 1e-6 * max(1.0, np.abs(wanted).max())
        for i in met:
            level = rows.slices[i + 1]
            missed = rows.jacobian[level] @ found - rows.target[level]
            assert np.abs(missed).max() < 1e-6


@pytest.mark.parametrize("name", ["panda", "upper17", "humanoid33"])
def test_what_the_last_levels_ask_for_leaves_the_levels_above_as_they_were(get_any, name):
    """At random states, singular ones among them, and whatever is asked for."""
    robot = get_any(name)
    stack = stack_for(robot)
    world, rng, kept = Rows(robot, stack), np.random.default_rng(5), 0
    recursion = OperationalRecursion(robot, RankTreatment())
    for seed in range(40):
        random_references(stack, rng, 30.0)
        state, answers = random_state(robot, seed, speed=0.5), []
        for size in (1.0, 100.0):
            for task in stack.levels[-1]:
                task.set_acceleration(size * rng.normal(size=task.dim))
            rows = world.at(state)
            answers.append(recursion.resolve(rows, world.dynamics))
        scale = np.abs(answers).max()
        # Where a level keeps its rank, those below are invisible to it.
        for level in rows.slices[: min(recursion.regular, len(rows.slices) - 1)]:
            change = rows.jacobian[level] @ (answers[1] - answers[0])
            assert np.abs(change).max(initial=0.0) < 1e-9 * scale
            kept += 1
    assert kept > 40


@pytest.mark.parametrize("name", FLOATING)
def test_a_posture_that_takes_all_that_is_left_needs_no_eigenvalues(get_any, monkeypatch, name):
    robot = get_any(name)
    world = Rows(robot, stack_for(robot))
    random_references(world.stack, np.random.default_rng(8))
    rows = world.at(near_home(robot, 0, spread=0.02))
    # More rows than freedom left, so that the posture cannot be one of the regular levels.
    assert len(rows.target) > robot.nv
    recursion = OperationalRecursion(robot, RankTreatment())
    monkeypatch.setattr(OperationalRecursion, "_take_tail", None)
    found = recursion.resolve(rows, world.dynamics)
    assert recursion.regular == len(rows.slices) - 1
    wanted = dense_acceleration(rows, world.dynamics, rank=RankTreatment())
    assert relative(found, wanted) < 1e-9


def singular_arm(robot, bend):
    """The home posture of arm6 with its elbow bent by an angle: straight at zero."""
    q = robot.q_home.copy()
    q[2] = bend
    return RobotState(q, np.zeros(robot.nv))


@pytest.mark.parametrize("softening", [0.0, 0.05])
def test_torques_are_continuous_and_bounded_through_a_singularity(get_any, softening):
    """The arm goes straight in small steps while its hand is pulled outwards."""
    robot = get_any("arm6")
    hand = FrameTask(robot.hands[0], "position")
    world = Rows(robot, Stack(levels=[[hand], [PostureTask()]], softening=softening))
    recursion = OperationalRecursion(robot, RankTreatment())
    hand.set_acceleration([15.0, 5.0, 5.0])
    changes = {}
    for count in (200, 400, 800):
        found = []
        for bend in np.linspace(-0.4, 0.4, count + 1):
            rows = world.at(singular_arm(robot, bend))
            found.append(recursion.resolve(rows, world.dynamics))
        changes[count] = np.abs(np.diff(found, axis=0)).max()
    # A jump would stay as large as it is, however small the steps.
    assert changes[400] < 0.7 * changes[200]
    assert changes[800] < 0.7 * changes[400]


@settings(max_examples=60, deadline=None)
@given(
    squares=st.lists(st.floats(-1e-12, 4.0), min_size=1, max_size=6),
    low=st.floats(1e-4, 0.3),
    width=st.floats(1e-3, 0.6),
)
def test_shares_rise_from_zero_to_one_and_gains_are_bounded(squares, low, width):
    rank = RankTreatment(low=low, high=low + width)
    values = np.sort(np.array(squares))
    share, gain = rank.activate(values)
    assert ((share >= 0.0) & (share <= 1.0)).all()
    assert (np.diff(share) >= 0.0).all()
    assert (share[values <= low * low * (1.0 - 1e-9)] == 0.0).all()
    exact = values >= (low + width) ** 2 * (1.0 + 1e-9)
    assert np.allclose(gain[exact] * values[exact], 1.0)
    # What a unit asked for makes of a direction: never more than at the lower threshold.
    assert (gain * np.sqrt(np.maximum(values, 0.0)) <= 1.0 / low + 1e-9).all()


def test_torques_of_a_stack_that_asks_for_too_much_are_finite_and_within_limits(get_any):
    robot = get_any("humanoid33")
    for stack, _ in redundant_stacks(robot).values():
        controller = OperationalSpaceController(robot, stack)
        for seed in range(5):
            random_references(stack, np.random.default_rng(seed), 100.0)
            command = controller.step(near_home(robot, seed, spread=0.1, time=1e-3 * seed))
            assert command.status.ok
            assert np.isfinite(command.torque).all()
            assert (np.abs(command.torque) <= robot.tau_max).all()


def test_the_whole_arm_again_below_a_hand_leaves_the_hand_alone(get_any):
    """The controller's own command, joint limits and all."""
    robot = get_any("panda")
    hand, again = FrameTask(robot.hands[0]), FrameTask(robot.hands[0], name="again")
    stack = Stack(levels=[[hand], [again], [PostureTask()]], softening=0.0)
    controller = OperationalSpaceController(robot, stack)
    rng = np.random.default_rng(7)
    for seed in SEEDS:
        random_references(stack, rng)
        again.set_acceleration(100.0 * rng.normal(size=6))
        command = controller.step(near_home(robot, seed, time=1e-3 * seed))
        assert np.abs(missing(hand, command.acceleration)).max() < 1e-6
