"""The constant error of an attitude that soles say, by made-up states and in the loop."""

import math

import numpy as np
import pinocchio as pin
import pytest

from poise.estimation import AttitudeBiasBelief, AttitudeBiasEstimator
from poise.robots import GRAVITY

DT, MASS = 0.002, 30.0


def learnt(bias, seconds, *, yaw=0.0, push=lambda t: 0.0, sway=0.0, estimator=None, load=1.0):
    """An estimator that has seen a robot sway, whose attitude is off about the base's x and y."""
    estimator = estimator or AttitudeBiasEstimator()
    world_R_base = pin.utils.rotate("z", yaw)
    for k in range(round(seconds / DT)):
        t = k * DT
        velocity = sway * np.array([math.sin(5.0 * t), math.cos(3.0 * t), 0.3 * math.sin(7.0 * t)])
        moves = sway * np.array(
            [5.0 * math.cos(5.0 * t), -3.0 * math.sin(3.0 * t), 2.1 * math.cos(7.0 * t)]
        )
        force = load * MASS * (moves + np.array([-push(t), 0.0, GRAVITY]))
        # The robot is seen turned by what of the error is not known yet.
        left = world_R_base @ np.array([*(np.array(bias) - estimator.bias), 0.0])
        seen = pin.exp3(left)
        estimator.update(t, seen @ force, seen @ velocity, seen @ world_R_base)
    return estimator


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_it_is_found_along_the_base_whatever_the_robot_weighs_and_does(yaw):
    bias = (0.012, -0.006)
    found = learnt(bias, 4.0, yaw=yaw, sway=0.05, load=1.2).bias
    np.testing.assert_allclose(found, bias, atol=1e-3)


def test_an_attitude_less_its_error_is_the_true_one():
    estimator = learnt((0.01, -0.005), 6.0)
    true = pin.Quaternion(pin.exp3(np.array([0.1, -0.2, 1.0])))
    seen = true * pin.Quaternion(pin.exp3(np.array([0.01, -0.005, 0.0])))
    corrected = pin.Quaternion(estimator.corrected(seen.coeffs()))
    assert true.angularDistance(corrected) < 1e-3


def test_little_is_believed_of_a_sudden_push():
    """0.2 m/s in 0.1 s: the soles' friction answers with a fifth of the weight."""
    estimator = learnt((0.0, 0.0), 5.0, push=lambda t: 2.0 if 4.0 < t < 4.1 else 0.0)
    assert np.abs(estimator.bias).max() < 1e-3


def test_it_stays_within_its_bounds_and_changes_no_faster_than_it_may():
    belief = AttitudeBiasBelief(most=0.02, rate=0.005, push=1.0)
    early = learnt((0.1, 0.0), 1.0, estimator=AttitudeBiasEstimator(belief)).bias
    assert 0.0 < early[0] <= 0.005
    late = learnt((0.1, 0.0), 10.0, estimator=AttitudeBiasEstimator(belief)).bias
    np.testing.assert_allclose(late, (0.02, 0.0), atol=1e-6)


@pytest.mark.parametrize(
    "force",
    [None, np.array([np.nan, 0.0, 300.0]), np.array([50.0, 0.0, 0.0])],
    ids=["one sole silent", "not a number", "no load"],
)
def test_what_is_of_no_use_changes_nothing(force):
    estimator = AttitudeBiasEstimator()
    for k in range(1000):
        estimator.update(k * DT, force, np.zeros(3), np.eye(3))
    assert not estimator.bias.any()


def test_a_clock_that_jumps_changes_nothing():
    estimator = AttitudeBiasEstimator()
    for time in (0.0, 10.0, 3.0, 3.0, math.nan, 8.0):
        estimator.update(time, np.array([30.0, 0.0, 300.0]), np.zeros(3), np.eye(3))
    assert not estimator.bias.any()


def test_a_stamp_that_comes_twice_and_a_force_that_is_missing_change_nothing():
    clean, spoiled = AttitudeBiasEstimator(), AttitudeBiasEstimator()
    force, still = np.array([20.0, 0.0, 600.0]), np.zeros(3)
    for tick in range(2000):
        time = 0.002 * tick
        for estimator in (clean, spoiled):
            estimator.update(time, force, still, np.eye(3))
        if tick % 50 == 0:
            spoiled.update(time, force, still, np.eye(3))
            spoiled.update(time + 0.001, np.full(3, np.nan), still, np.eye(3))
    assert np.linalg.norm(clean.bias) > 1e-3
    np.testing.assert_allclose(spoiled.bias, clean.bias, rtol=1e-6)
