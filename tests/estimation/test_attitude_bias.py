"""Constant error of an attitude by the soles' forces: made-up states, and beside other errors."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from test_hands import felt

from poise.control import WholeBodyController
from poise.dynamics import RobotState
from poise.estimation import PayloadBelief, PayloadEstimator, StateEstimator
from poise.locomotion import Walker, walking_stack
from poise.sim import Plant, PlantConfig, SensorConfig, rollout

DT = 0.004


def seen(state, bias, estimator):
    """A state whose attitude is off about the base's x and y, corrected as far as is known."""
    q = state.q.copy()
    off = pin.Quaternion(q[3:7]) * pin.Quaternion(pin.exp3(np.array([*bias, 0.0])))
    q[3:7] = estimator.corrected(off.coeffs())
    return replace(state, q=q)


def learnt(robot, bias, seconds, *, yaw=0.0, push=None, sway=0.0, load=1.0, belief=None):
    """An estimator that has seen a robot sway, whose attitude is off about the base's x and y."""
    estimator = PayloadEstimator(robot, belief, attitude=True)
    world_R_base = pin.utils.rotate("z", yaw)
    heavy = robot.carrying(robot.torso, (load - 1.0) * robot.mass) if load > 1.0 else robot
    q = robot.q_home.copy()
    q[3:7] = pin.Quaternion(world_R_base).coeffs()
    v, a = np.zeros(robot.nv), np.zeros(robot.nv)
    for t in DT * np.arange(round(seconds / DT)):
        way = np.array([math.sin(5.0 * t), math.cos(3.0 * t), 0.3 * math.sin(7.0 * t)])
        rate = np.array(
            [5.0 * math.cos(5.0 * t), -3.0 * math.sin(3.0 * t), 2.1 * math.cos(7.0 * t)]
        )
        v[:3], a[:3] = sway * world_R_base.T @ way, sway * world_R_base.T @ rate
        pushed = None if push is None else (np.array([push(t) * robot.mass, 0.0, 0.0]), None)
        estimator.update(seen(felt(robot, heavy, q, v, a, t, push=pushed), bias, estimator))
    return estimator


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_it_is_found_along_the_base_whatever_the_robot_weighs_and_does(get_robot, yaw):
    robot, bias = get_robot("g1"), (0.012, -0.006)
    estimator = learnt(robot, bias, 4.0, yaw=yaw, sway=0.05, load=1.2)
    np.testing.assert_allclose(estimator.tilt, bias, atol=1e-3)
    assert estimator.mass == pytest.approx(0.2 * robot.mass, rel=0.05)


def test_little_is_believed_of_a_sudden_push(get_robot):
    """0.2 m/s in 0.1 s: the soles' friction answers with a fifth of the weight."""
    estimator = learnt(
        get_robot("g1"), (0.0, 0.0), 5.0, push=lambda t: 2.0 if 4.0 < t < 4.1 else 0.0
    )
    assert np.abs(estimator.tilt).max() < 1e-3


def test_it_stays_within_its_bounds_and_changes_no_faster_than_it_may(get_robot):
    robot = get_robot("g1")
    belief = PayloadBelief(tilt_max=0.02, tilt_rate=0.005, push=1.0)
    early = learnt(robot, (0.1, 0.0), 1.0, belief=belief).tilt
    assert 0.0 < early[0] <= 0.005
    late = learnt(robot, (0.1, 0.0), 10.0, belief=belief).tilt
    np.testing.assert_allclose(late, (0.02, 0.0), atol=1e-6)


def leaning(robot, times, force=(20.0, 0.0, 600.0)):
    """States at rest in which each sole carries half of a force."""
    half = dict.fromkeys(robot.soles, np.array([*np.multiply(force, 0.5), 0.0, 0.0, 0.0]))
    return [RobotState(robot.q_home, np.zeros(robot.nv), half, t) for t in times]


@pytest.mark.parametrize(
    "force",
    [None, (np.nan, 0.0, 300.0), (50.0, 0.0, 0.0)],
    ids=["one sole silent", "not a number", "no load"],
)
def test_what_is_of_no_use_changes_nothing(get_robot, force):
    robot = get_robot("g1")
    estimator = PayloadEstimator(robot, attitude=True)
    for state in leaning(robot, 0.002 * np.arange(1000), force or (20.0, 0.0, 600.0)):
        if force is None:
            first, *_ = robot.soles
            state = replace(state, contacts={first: state.contacts[first]})
        estimator.update(state)
    assert not estimator.tilt.any()


def test_without_it_an_attitude_stays_as_it_is(get_robot):
    robot = get_robot("g1")
    estimator = PayloadEstimator(robot)
    for state in leaning(robot, 0.002 * np.arange(1000)):
        estimator.update(state)
    assert not estimator.tilt.any()
    np.testing.assert_array_equal(estimator.corrected(robot.q_home[3:7]), robot.q_home[3:7])


def test_payload_gyro_bias_and_zeros_are_found_beside_each_other_on_a_walk(get_robot):
    robot = get_robot("g1")
    off = 0.01 * robot.weight
    sensors = replace(
        SensorConfig.typical(),
        gyro_bias=0.01,
        gyro_noise=0.0,
        force_bias=off,
        moment_bias=0.05 * off,
        force_noise=0.0,
        moment_noise=0.0,
        delay=0.0,
    )
    config = PlantConfig(
        control_dt=0.002,
        sensors=sensors,
        payloads=(PlantConfig.Payload(frame=robot.torso, mass=2.0),),
    )
    plant = Plant(robot, config, seed=1)
    stack = walking_stack(robot)
    walker, controller = Walker(robot, stack), WholeBodyController(robot, stack)
    payload = PayloadEstimator(robot)
    estimator = StateEstimator(robot, q_start=plant.true_state().q, payload=payload)
    walker.set_velocity(0.2)
    for _ in rollout(plant, controller, walker, estimator=estimator, duration=5.0):
        pass
    assert not plant.fallen
    measured, true = plant.state(), plant.true_state()
    assert payload.mass == pytest.approx(2.0, abs=0.3)
    bias = measured.readings.angular_velocity - true.v[3:6]
    assert np.linalg.norm(bias) > 0.005
    np.testing.assert_allclose(estimator.filter.gyro_bias, bias, atol=2e-3)
    assert set(estimator.tare.zeros) == set(robot.soles)
    for sole, zero in estimator.tare.zeros.items():
        error = measured.contacts[sole] - true.contacts[sole]
        np.testing.assert_allclose(zero, error, rtol=0.0, atol=0.02 * off)
