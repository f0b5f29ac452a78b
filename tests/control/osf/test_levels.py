"""Residuals of a level do not depend on the levels below it."""

import math

import numpy as np
import pytest
from oracles import near_home
from osf_world import Rows, missing, random_references, stack_for

from poise.control import OperationalSpaceController, RankTreatment
from poise.control._osf._recursion import OperationalRecursion
from poise.stack import FrameTask, JointLimit, JointTask, PostureTask, Stack


@pytest.mark.parametrize("name", ["panda", "upper17", "humanoid33", "g1"])
def test_asking_a_level_for_more_costs_no_level_above(get_any, name):
    """Also with active bounds of joints, balance, cones and torque limits."""
    robot, bounded, compared = get_any(name), 0, 0
    plain = stack_for(robot)
    limit = JointLimit(acceleration_max=30.0)
    stack = Stack(plain.contacts, plain.levels, joint_limit=limit, softening=0.0)
    controller = OperationalSpaceController(robot, stack, torque_step=math.inf)
    rng = np.random.default_rng(3)
    for seed in range(12):
        state = near_home(robot, seed)
        random_references(stack, rng, 2.0)
        for level in range(1, len(stack.levels)):
            asked = [(task, rng.normal(size=task.dim)) for task in stack.levels[level]]
            found = []
            for factor in (2.0, 10.0, 50.0):
                for task, reference in asked:
                    task.set_acceleration(factor * reference)
                command = controller.step(state)
                assert command.status.ok
                found.append(command.residuals[2 : 2 + level])
                bounded += controller.strategy.forces.bounded
            assert np.max(np.array(found[1:]) - found[0]) <= 1e-9
            compared += 1
    assert compared >= 24
    # Both ways took part: the closed form, and that within bounds.
    assert bounded > 12


def test_a_joint_that_a_low_level_drives_out_costs_the_hand_nothing(get_any):
    """A redundant arm: the posture's joint stays at its bound, the hand has what it asks for."""
    robot = get_any("panda")
    hand = FrameTask(robot.hands[0])
    stack = Stack(
        levels=[[hand], [PostureTask()]],
        joint_limit=JointLimit(acceleration_max=20.0),
        softening=0.0,
    )
    controller, posture = OperationalSpaceController(robot, stack), stack.levels[1][0]
    for seed in range(10):
        hand.set_acceleration([0.2, 0.1, -0.2, 0.0, 0.0, 0.0])
        posture.set_acceleration(1e3 * np.random.default_rng(seed).normal(size=robot.nv))
        command = controller.step(near_home(robot, seed, spread=0.02, speed=0.02))
        assert np.abs(missing(hand, command.acceleration)).max() < 1e-6
        assert np.abs(command.acceleration).max() <= 20.0 + 1e-5
        assert "held at their limits" in controller.status().explanation


def test_a_level_that_cannot_be_met_takes_the_least_squares_of_its_scaled_rows(get_any):
    """Weights over the home mobility of the rows, below what the levels above have taken."""
    robot = get_any("panda")
    levels = [
        [JointTask(["panda_joint2"])],
        [FrameTask(robot.hands[0], weight=2.0), PostureTask(weight=0.3)],
    ]
    world = Rows(robot, Stack(levels=levels, softening=0.0))
    rng, recursion = np.random.default_rng(2), OperationalRecursion(robot, RankTreatment())
    for seed in range(10):
        random_references(world.stack, rng)
        rows = world.at(near_home(robot, seed))
        found = recursion.resolve(rows, world.dynamics)
        _, first, second = rows.slices
        assert np.abs(rows.jacobian[first] @ found - rows.target[first]).max() < 1e-9
        # The optimum: no motion that the first level leaves makes the scaled sum smaller.
        null = np.linalg.svd(rows.jacobian[first])[2][1:]
        scale = rows.scale[second]
        A = scale[:, None] * rows.jacobian[second]
        c = scale * (rows.target[second] - rows.jacobian[second] @ found)
        assert np.linalg.norm(c) > 0.1
        assert np.abs(null @ A.T @ c).max() < 1e-8 * np.linalg.norm(A) * np.linalg.norm(c)
