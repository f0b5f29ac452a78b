"""Levels that cannot be met are softened as in the other controllers, and come to rest."""

import math

import numpy as np
import pytest
from oracles import near_home
from osf_world import Rows

from poise.control import OperationalSpaceController, RankTreatment
from poise.control._osf._recursion import OperationalRecursion
from poise.dynamics import RobotState
from poise.sim import Plant
from poise.stack import FrameTask, PostureTask, Stack

SOFTENING = 0.05


def far_hand(robot, softening=SOFTENING):
    hand = FrameTask(robot.hands[0], "position")
    return hand, Stack(levels=[[hand], [PostureTask()]], softening=softening)


@pytest.mark.parametrize("bend", [-0.5, -0.02, 0.0])
def test_a_softened_level_is_the_optimum_of_its_own_term(get_any, bend):
    """|W (J dv - target)|^2 + mu^2 |dv_J - d|^2, regular and singular: arm6 bent and straight."""
    robot = get_any("arm6")
    hand, stack = far_hand(robot)
    world = Rows(robot, stack)
    q = robot.q_home.copy()
    q[2] = bend
    state = RobotState(q, 0.1 * np.random.default_rng(0).normal(size=6))
    world.at(state)
    hand.set_target(hand.target_position + [0.3, 0.1, 0.2])
    rows, recursion = world.at(state), OperationalRecursion(robot, RankTreatment())
    d = world.rows.stack_rows.softening.terms.reference
    found = recursion.resolve(rows, world.dynamics)
    mu, J, t = float(rows.softened[1]), hand.jacobian, rows.target[rows.slices[1]]
    weight = world.rows.stack_rows.softening.terms.weights[0]
    assert mu >= weight - 1e-12
    assert mu == pytest.approx(weight, rel=1e-9) or bend > -0.1
    stacked = np.vstack((J, mu * np.eye(6))), np.concatenate((t, mu * d))
    best = np.linalg.lstsq(*stacked, rcond=None)[0]
    assert np.abs(J @ (found - best)).max() < 1e-6
    assert np.linalg.norm(J @ found - t) > 1e-3


def test_without_error_the_answer_is_the_strict_one_bit_for_bit(get_any):
    robot, torques = get_any("panda"), []
    for softening in (0.0, SOFTENING):
        _, stack = far_hand(robot, softening)
        controller = OperationalSpaceController(robot, stack, torque_step=math.inf)
        torques.append(controller.step(near_home(robot, 0, spread=0.02)).torque)
        assert not controller.status().softened
    assert (torques[0] == torques[1]).all()


def test_the_status_says_which_levels_are_softened(get_any):
    robot = get_any("panda")
    hand, stack = far_hand(robot)
    controller = OperationalSpaceController(robot, stack)
    state = near_home(robot, 0, spread=0.02, speed=0.0)
    controller.step(state)
    assert controller.strategy.softened == {}
    hand.set_target(hand.target_position + [3.0, 0.0, 0.0])
    controller.step(state)
    assert controller.strategy.softened.keys() == {0}
    assert controller.status().softened.keys() == {3}
    assert "level 3 is softened" in controller.status().explanation


@pytest.mark.parametrize("way", [[1.5, 0.0, 0.0], [0.0, 0.0, 2.0]])
def test_an_arm_whose_target_is_out_of_reach_comes_to_rest(get_any, way):
    robot = get_any("panda")
    hand, stack = far_hand(robot)
    controller = OperationalSpaceController(robot, stack, torque_step=math.inf)
    plant = Plant(robot)
    last, steps, speeds = controller.step(plant.state()).torque, [], []
    start = hand.target_position.copy()
    while plant.time < 3.0:
        hand.set_target(start + min(plant.time / 1.5, 1.0) * np.array(way))
        state = plant.state()
        command = controller.step(state)
        if plant.time > 2.5:
            steps.append((np.abs(command.torque - last) / robot.tau_max).max())
            speeds.append(np.abs(state.v).max())
        last = command.torque
        plant.step(command)
    assert np.linalg.norm(hand.error) > 0.3
    assert max(steps) < 0.01
    assert max(speeds) < 0.05
