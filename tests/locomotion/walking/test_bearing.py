"""Where a foot can carry the robot by itself, and what a walk does with it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from poise.locomotion._support import bearing
from poise.locomotion._walking._footsteps import stand_of
from poise.locomotion._walking._ground import Placement

ROLL = ".*_ankle_roll"


def weakened(robot, joint, lever):
    """The robot with an ankle that holds its weight so far from its axis [m]."""
    torques = robot.tau_max.copy()
    torques[[i for i, name in enumerate(robot.joint_names) if joint in name]] = lever * robot.weight
    return replace(robot, tau_max=torques)


def test_a_strong_leg_bears_on_all_of_its_sole(get_robot):
    robot = get_robot("humanoid33")
    assert bearing(robot, "left_sole", 1.0) == pytest.approx((0.0, 0.0, 0.28, 0.14))


def test_a_weak_ankle_bears_where_its_torque_holds_the_weight(get_robot):
    robot = weakened(get_robot("humanoid33"), "ankle_pitch", 0.1)
    # The ankle is 30 mm behind the sole's middle, and its back edge 140 mm.
    assert bearing(robot, "left_sole", 1.0) == pytest.approx((-0.03, 0.0, 0.2, 0.14))
    robot = weakened(get_robot("humanoid33"), "ankle_pitch", 0.15)
    assert bearing(robot, "left_sole", 1.0) == pytest.approx((-0.01, 0.0, 0.26, 0.14))
    robot = weakened(get_robot("humanoid33"), "ankle_roll", 0.05)
    assert bearing(robot, "left_sole", 1.0) == pytest.approx((0.0, 0.0, 0.28, 0.1))


def test_a_sole_that_leans_bears_on_its_outer_edge(get_robot_without):
    robot = get_robot_without(ROLL)
    assert bearing(robot, "left_sole", 1.0) == pytest.approx((0.0, 0.07, 0.28, 0.0))
    assert bearing(robot, "right_sole", -1.0) == pytest.approx((0.0, -0.07, 0.28, 0.0))


def test_the_zmp_goes_along_with_a_foot_and_turns_with_it(get_robot_without):
    stand = stand_of(get_robot_without(ROLL))
    turned = Placement(position=(1.0, 2.0, 0.0), yaw=0.5 * math.pi)
    assert stand.zmp(0, turned) == pytest.approx((1.0 - 0.07, 2.0))
    assert stand.zmp(1, turned) == pytest.approx((1.0 + 0.07, 2.0))
    np.testing.assert_allclose(stand.rest((turned, turned)), (1.0, 2.0), atol=1e-12)


def test_feet_whose_soles_lean_come_nearer_to_each_other_but_do_not_touch(
    get_robot, get_robot_without
):
    firm, leaning = stand_of(get_robot("humanoid33")), stand_of(get_robot_without(ROLL))
    assert firm.width == pytest.approx(0.205)
    assert 0.15 < leaning.width < firm.width
