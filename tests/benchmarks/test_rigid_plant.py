"""The fixed-base plant against an independent integrator and an independent equation of motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.rigid_plant import EARTH, Gravity, RigidPlant, set_gravity, with_gravity
from poise.control import OperationalSpaceController
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
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


def test_the_given_robot_is_left_alone(arm):
    mass, start = arm.mass, arm.q_home.copy()
    plant = RigidPlant(arm, start, gravity=Gravity(first=-1.0, last=5.0), inertia_scale=1.5)
    plant.advance(np.zeros(6), 0.01)
    assert arm.model.gravity.linear[2] == EARTH
    assert arm.mass == mass
    assert plant.robot.mass == pytest.approx(1.5 * mass)
    np.testing.assert_array_equal(start, arm.q_home)


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


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"inertia_scale": 0.0}, "inertia_scale"),
        ({"inertia_scale": float("nan")}, "inertia_scale"),
        ({"step": -1e-4}, "step"),
        ({"q": np.zeros(5)}, "posture"),
        ({"q": np.full(6, np.nan)}, "posture"),
    ],
)
def test_numbers_that_cannot_be_are_refused(arm, change, words):
    with pytest.raises(ConfigurationError, match=words):
        RigidPlant(arm, **({"q": arm.q_home.copy()} | change))


def test_a_floating_base_is_refused():
    robot = load_robot("biped20")
    with pytest.raises(ConfigurationError, match="fixed base"):
        RigidPlant(robot, robot.q_home.copy())


@pytest.mark.parametrize(
    "wrong",
    [
        {"first": float("nan")},
        {"first": float("-inf")},
        {"last": float("nan")},
        {"duration": 0.0},
        {"duration": float("nan")},
    ],
)
def test_gravity_that_is_no_number_is_refused(wrong):
    with pytest.raises(ConfigurationError, match="gravity"):
        Gravity(**wrong)


def test_swept_gravity_starts_and_stays_where_it_is_told():
    gravity = Gravity(first=-9.8, last=9.8, duration=2.0)
    assert [gravity.at(t) for t in (0.0, 1.0, 2.0, 5.0)] == pytest.approx([-9.8, 0.0, 9.8, 9.8])
    assert not gravity.constant
    assert Gravity(first=-3.71).at(7.0) == -3.71
