"""The fixed-base plant against an independent integrator and an independent equation of motion."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.rigid_plant import (
    EARTH,
    Encoder,
    Gravity,
    JointSensors,
    RigidPlant,
    set_gravity,
    with_gravity,
)
from poise.control import OperationalSpaceController
from poise.dynamics import Dynamics, RobotState
from poise.robots import load_robot
from poise.sim import rollout
from poise.stack import PostureTask, Stack

DURATION = 0.2


@pytest.fixture(scope="module")
def arm():
    return load_robot("arm6")


def reference(robot, q, torque, gravity, scale):
    """The motion by another method (Dormand-Prince of order 8) and M^-1 (torque - h)."""
    own = with_gravity(robot, gravity.at(0.0))
    for i in range(1, own.model.njoints):
        own.model.inertias[i].mass *= scale
        own.model.inertias[i].inertia = own.model.inertias[i].inertia * scale
    dynamics, n = Dynamics(own), robot.nv

    def rate(time, x):
        set_gravity(own, gravity.at(time))
        dynamics.update(RobotState(x[:n], x[n:]))
        return np.concatenate((x[n:], np.linalg.solve(dynamics.M, torque - dynamics.h)))

    start = np.concatenate((q, np.zeros(n)))
    done = solve_ivp(rate, (0.0, DURATION), start, method="DOP853", rtol=1e-12, atol=1e-12)
    return done.y[:, -1]


@pytest.mark.parametrize(
    ("gravity", "scale"),
    [
        (Gravity(), 1.0),
        (Gravity(first=-9.8, last=9.8, duration=DURATION), 1.0),
        (Gravity(first=-3.71), 1.2),
    ],
    ids=["earth", "swept", "mars, heavier"],
)
def test_the_plant_moves_as_another_integrator_says(arm, gravity, scale):
    torque = np.array([5.0, -20.0, 8.0, 3.0, -2.0, 1.0])
    plant = RigidPlant(arm, arm.q_home.copy(), gravity=gravity, inertia_scale=scale)
    plant.advance(torque, DURATION)
    expected = reference(arm, arm.q_home, torque, gravity, scale)
    assert plant.time == pytest.approx(DURATION)
    assert np.abs(expected[:6] - arm.q_home).max() > 0.1
    np.testing.assert_allclose(np.concatenate((plant.q, plant.v)), expected, atol=1e-8)


def test_the_error_falls_with_the_fourth_power_of_the_step(arm):
    torque, errors = np.array([5.0, -20.0, 8.0, 3.0, -2.0, 1.0]), []
    expected = reference(arm, arm.q_home, torque, Gravity(), 1.0)
    for step in (8e-3, 4e-3):
        plant = RigidPlant(arm, arm.q_home.copy(), step=step)
        plant.advance(torque, DURATION)
        errors.append(np.abs(plant.q - expected[:6]).max())
    assert 10.0 < errors[0] / errors[1] < 25.0


def test_a_controller_that_is_not_told_keeps_its_own_gravity(arm):
    swept = Gravity(first=EARTH, last=0.0, duration=0.01)
    for known in (True, False):
        own = with_gravity(arm, EARTH)
        controller = OperationalSpaceController(own, Stack([], [[PostureTask()]]))
        plant = RigidPlant(arm, arm.q_home.copy(), gravity=swept)

        def tell(_, own=own, plant=plant, known=known):
            if known:
                set_gravity(own, plant.gravity)

        moments = [plant.moment for _ in rollout(plant, controller, tell, duration=0.011)]
        assert moments[-1].gravity == pytest.approx(0.0)
        assert own.model.gravity.linear[2] == pytest.approx(0.0 if known else EARTH)
        # Told, it holds still; not told, it pushes the arm up.
        moved = max(np.abs(moment.acceleration).max() for moment in moments)
        assert (moved < 1.0) == known


def test_angles_are_whole_steps_and_the_nearest_ones():
    encoder, rng = Encoder(bits=10, gear=3.0), np.random.default_rng(0)
    q = rng.uniform(-3.0, 3.0, 1000)
    read = encoder.read(q)
    steps = read / encoder.resolution
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert np.abs(read - q).max() <= 0.5 * encoder.resolution * (1 + 1e-12)
    np.testing.assert_array_equal(encoder.read(read), read)


def test_velocity_is_the_backward_difference_of_read_angles():
    encoder = Encoder()
    sensors, true_v = JointSensors(encoder), np.array([0.3])
    states = [sensors.read(true_v * t, true_v, t) for t in (0.0, 1e-3, 2e-3)]
    assert states[0].v[0] == 0.0
    for before, now in pairwise(states):
        assert now.v[0] == pytest.approx((now.q[0] - before.q[0]) / 1e-3)
        assert now.v[0] != 0.3
        assert abs(now.v[0] - 0.3) <= encoder.resolution / 1e-3
