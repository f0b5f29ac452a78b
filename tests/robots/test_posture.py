"""Postures and the inverse kinematics that finds them, against finite differences."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from poise.robots import frame_error, inverse_kinematics, standing_posture


@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_soles_base_and_com_are_where_a_standing_posture_has_them(get_robot, name):
    robot = get_robot(name)
    height = 0.95 * float(pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)[2])
    q = standing_posture(robot, feet_apart=0.22, com_height=height)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    for sole, y in zip(robot.soles, (0.11, -0.11), strict=True):
        pose = data.oMf[robot.frame_id(sole)]
        np.testing.assert_allclose(pose.translation, [0.0, y, 0.0], atol=1e-8)
        np.testing.assert_allclose(pose.rotation, np.eye(3), atol=1e-8)
    com = pin.centerOfMass(robot.model, data, q)
    np.testing.assert_allclose(com, [0.0, 0.0, height], atol=1e-8)
    np.testing.assert_allclose(q[3:7], [0.0, 0.0, 0.0, 1.0], atol=1e-8)


def test_a_root_link_may_point_anywhere(get_robot):
    robot = get_robot("icub")
    assert np.abs(robot.q_home[3:6]).max() > 0.9
    q = standing_posture(robot)
    data = robot.model.createData()
    com = pin.centerOfMass(robot.model, data, q)
    before = pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)
    np.testing.assert_allclose(com, [0.0, 0.0, before[2]], atol=1e-8)
    turn = pin.Quaternion(q[3:7]).matrix().T @ pin.Quaternion(robot.q_home[3:7]).matrix()
    np.testing.assert_allclose(turn, np.eye(3), atol=1e-8)


@pytest.fixture(scope="module")
def hand(get_robot):
    """A fixed arm's model and data, its hand's frame, and a configuration amid its range."""
    robot = get_robot("arm6")
    data = robot.model.createData()
    q = np.array([0.3, -0.5, 0.9, -0.4, 0.7, 0.2])
    return robot.model, data, robot.frame_id(robot.hands[0]), q


def error_at(hand, q, goal):
    model, data, frame, _ = hand
    pin.computeJointJacobians(model, data, q)
    return frame_error(model, data, frame, goal)


def goal_at(hand, q):
    model, data, frame, _ = hand
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[frame].copy()


def test_the_jacobian_of_a_frames_error_is_its_difference(hand):
    model, _, _, q = hand
    goal, h = goal_at(hand, q), 1e-6
    _, jacobian = error_at(hand, q, goal)
    for i in range(model.nv):
        step = h * np.eye(model.nv)[i]
        ahead, _ = error_at(hand, pin.integrate(model, q, step), goal)
        behind, _ = error_at(hand, pin.integrate(model, q, -step), goal)
        np.testing.assert_allclose((behind - ahead) / (2.0 * h), jacobian[:, i], atol=1e-7)


def solved(hand, goal, **change):
    settings = {"tolerance": 1e-12, "damping": 1e-12, "step_max": 0.5, "iterations": 50} | change
    model, _, _, q = hand
    return solve(model, q, lambda q: error_at(hand, q, goal), range(6), **settings)


def solve(model, q, linearize, free, **settings):
    """Inverse kinematics of one level: the configuration and the error."""
    q, ((error, _),) = inverse_kinematics(model, q, lambda q: [linearize(q)], free, **settings)
    return q, error


def test_its_error_falls_quadratically_near_a_goal(hand):
    q = hand[3]
    goal = goal_at(hand, q + 0.02 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0]))
    sizes = [np.abs(solved(hand, goal, iterations=n)[1]).max() for n in range(4)]
    for before, after in pairwise(sizes):
        # The least singular value of J is 0.03: its inverse stands before the square.
        assert after < 100.0 * before**2 + 1e-12


def test_a_goal_far_away_is_reached_by_steps_no_longer_than_allowed(hand):
    model, _, _, q = hand
    goal = goal_at(hand, q + 0.3)
    found, error = solved(hand, goal)
    assert np.abs(error).max() < 1e-12
    np.testing.assert_allclose(goal_at(hand, found).homogeneous, goal.homogeneous, atol=1e-11)
    one, _ = solved(hand, goal, step_max=0.01, iterations=1)
    assert np.abs(pin.difference(model, q, one)).max() == pytest.approx(0.01)


SETTINGS = {"tolerance": 1e-9, "damping": 1e-9, "step_max": 0.2, "iterations": 300}


def test_a_lower_level_takes_nothing_from_a_higher_one_that_it_contradicts(hand):
    model, _, _, q = hand
    goal, far = goal_at(hand, q + 0.2), goal_at(hand, q - 0.2)

    def linearize(q):
        (must, J_must), (wish, J_wish) = error_at(hand, q, goal), error_at(hand, q, far)
        return [(must[:3], J_must[:3]), (wish, J_wish)]

    found, levels = inverse_kinematics(model, q, linearize, range(6), **SETTINGS)
    assert np.abs(levels[0][0]).max() < 1e-7
    # It does use what is free: turned nearer to its own goal than the first level alone leaves it.
    alone, _ = inverse_kinematics(model, q, lambda q: linearize(q)[:1], range(6), **SETTINGS)
    misses = [np.linalg.norm(linearize(x)[1][0][3:]) for x in (found, alone)]
    assert misses[0] < 0.01 * misses[1]


def test_joints_stay_within_bounds_and_the_others_do_what_they_can(hand):
    model, _, _, q = hand
    goal = goal_at(hand, q + 0.3)
    bounds = q - 0.1, q + 0.1
    found, ((error, _),) = inverse_kinematics(
        model, q, lambda q: [error_at(hand, q, goal)], range(6), bounds=bounds, **SETTINGS
    )
    assert (found >= bounds[0]).all()
    assert (found <= bounds[1]).all()
    assert np.linalg.norm(error) < np.linalg.norm(error_at(hand, q, goal)[0])
    wide, ((error, _),) = inverse_kinematics(
        model,
        q,
        lambda q: [error_at(hand, q, goal)],
        range(6),
        bounds=(q - 0.4, q + 0.4),
        **SETTINGS,
    )
    assert np.abs(error).max() < 1e-8
    np.testing.assert_allclose(wide, q + 0.3, atol=1e-6)
