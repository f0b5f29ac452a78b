"""Zeros of load cells: from made-up wrenches, and in the loop on a robot whose cells are off."""

from dataclasses import replace

import numpy as np
import pytest
from slow import slow
from walker import hands

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.dynamics import RobotState
from poise.estimation import LoadCellTare
from poise.locomotion import WayPoint
from poise.sim import PlantConfig, SensorConfig

DT, WEIGHT = 0.002, 300.0
ZERO = np.array([3.0, -2.0, 4.0, 0.3, -0.2, 0.1])


def told(tare, ticks, wrench, airborne, start=0, time=None):
    """What a tare makes of the left sole's wrenches, the right one always carrying."""
    for k in range(start, start + ticks):
        contacts = {"left": wrench(k), "right": np.array([0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0])}
        now = k * DT if time is None else time
        state = tare.update(RobotState(np.zeros(7), np.zeros(6), contacts, now), airborne)
    return state


def off(k):
    return ZERO.copy()


def test_what_a_sole_says_in_the_air_is_taken_off_on_the_ground():
    rng = np.random.default_rng(5)
    tare = LoadCellTare(("left", "right"), WEIGHT)
    told(tare, 500, lambda k: ZERO + rng.normal(0.0, 0.5, 6), (True, False))
    load = np.array([5.0, 1.0, 150.0, 2.0, 1.0, 0.0])
    state = told(tare, 1, lambda k: load + ZERO, (False, False), start=500)
    # The mean of 500 samples.
    np.testing.assert_allclose(state.contacts["left"], load, atol=4.0 * 0.5 / 500**0.5)
    np.testing.assert_array_equal(state.contacts["right"], [0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0])


def test_a_zero_that_drifts_is_followed():
    tare = LoadCellTare(("left", "right"), WEIGHT)
    told(tare, 5000, off, (True, False))
    told(tare, 10000, lambda k: 2.0 * ZERO, (True, False), start=5000)
    np.testing.assert_allclose(tare.zeros["left"], 2.0 * ZERO, rtol=0.03)


@pytest.mark.parametrize(
    "wrench",
    [
        [20.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 100.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 5.0, 0.0],
        [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0],
        "none",
    ],
)
def test_what_touches_something_and_what_is_no_wrench_teaches_nothing(wrench):
    given = wrench if isinstance(wrench, str) else np.array(wrench)
    tare = LoadCellTare(("left", "right"), WEIGHT)
    told(tare, 100, off, (True, False))
    state = told(tare, 100, lambda k: given, (True, False), start=100)
    np.testing.assert_array_equal(tare.zeros["left"], ZERO)
    if state.wrench("left") is None:
        assert state.contacts["left"] is given


def test_a_sole_that_says_nothing_and_a_clock_that_stands_or_jumps_teach_nothing():
    tare = LoadCellTare(("left", "right"), WEIGHT)
    tare.update(RobotState(np.zeros(7), np.zeros(6), {}, 0.0), (True, True))
    told(tare, 20, off, (True, False), time=0.0)
    for time in (100.0, 50.0, 200.0):
        told(tare, 1, off, (True, False), time=time)
    assert not tare.zeros


def test_forgotten_a_zero_is_zero():
    tare = LoadCellTare(("left", "right"), WEIGHT)
    told(tare, 20, off, (True, False))
    tare.reset()
    state = told(tare, 1, off, (False, False))
    np.testing.assert_array_equal(state.contacts["left"], ZERO)


@pytest.mark.parametrize("robot_name", ["humanoid33", slow("g1")])
def test_after_a_step_with_each_foot_the_cells_zeros_are_known(get_robot, robot_name):
    """Soles are off by some 1% of the weight along each axis, and by a moment at 5 cm of that."""
    run, off = after_steps(get_robot(robot_name))
    check_zeros(run, off)


@pytest.mark.slow
def test_zeros_payload_and_attitude_are_found_beside_each_other(get_robot):
    robot, askew = get_robot("g1"), (0.009, -0.006)
    load = PlantConfig.Payload(frame=robot.torso, mass=1.5)
    run, off = after_steps(robot, 6.0, payloads=(load,), base_orientation_error=askew)
    check_zeros(run, off)
    payload = run.teleoperator.estimator.payload
    # Arms that swing as the robot steps have a part of it for a while.
    assert payload.mass + payload.held.sum() == pytest.approx(1.5, abs=0.1)
    np.testing.assert_allclose(payload.tilt, askew, atol=1.5e-3)


def after_steps(robot, duration=3.6, *, payloads=(), **more):
    """A run of a step with each foot, and the deviation of its cells' zeros [N]."""
    off = 0.01 * robot.weight
    sensors = replace(
        SensorConfig.typical(),
        force_bias=off,
        moment_bias=0.05 * off,
        force_noise=0.0,
        moment_noise=0.0,
        **more,
    )
    plant = replace(TORQUE_TELEOP_PLANT, sensors=sensors, payloads=payloads)
    up = [(0.1, 0.0), (0.4, 0.06), (0.9, 0.06), (1.2, -0.02)]
    points = [WayPoint(at=at, left=(0.0, 0.0, z)) for at, z in up]
    points += [WayPoint(at=1.7 + at, right=(0.0, 0.0, z)) for at, z in up]
    run = run_teleop(robot, hands(*points), plant, duration=duration, seed=4)
    assert not run.fell
    return run, off


def check_zeros(run, off):
    measured, true = run.plant.state(), run.plant.true_state()
    for sole, zero in run.teleoperator.estimator.tare.zeros.items():
        error = measured.contacts[sole] - true.contacts[sole]
        assert np.linalg.norm(error) > 0.5 * off
        np.testing.assert_allclose(zero, error, rtol=0.0, atol=0.01 * off)
    assert len(run.teleoperator.estimator.tare.zeros) == 2
