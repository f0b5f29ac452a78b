"""States carried on over the delay of the sensors."""

import numpy as np
import pinocchio as pin
import pytest

import poise
from poise.errors import ConfigurationError
from poise.estimation import StatePredictor

T = 0.002


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


def state_of(robot, v):
    q = pin.integrate(robot.model, robot.q_home, 0.1 * np.ones(robot.nv))
    return poise.RobotState(q, v, {}, 1.0)


def test_it_is_where_integration_with_a_hundredth_of_the_period_gets(robot):
    random = np.random.default_rng(0)
    predictor = StatePredictor(robot, 10 * T, T)
    accelerations = random.normal(size=(10, robot.nv), scale=5.0)
    state = state_of(robot, random.normal(size=robot.nv, scale=0.5))
    q, v = state.q.copy(), state.v.copy()
    for a in accelerations:
        predictor.command(a)
        for _ in range(100):
            q, v = pin.integrate(robot.model, q, T / 100 * v), v + T / 100 * a
    found = predictor.predict(state)
    np.testing.assert_allclose(found.v, v, atol=1e-12)
    # First order in the rotation within the delay.
    assert np.abs(pin.difference(robot.model, found.q, q)).max() < 2e-4
    assert found.time == pytest.approx(1.0 + 10 * T)


def test_only_what_was_commanded_within_the_delay_counts(robot):
    predictor = StatePredictor(robot, 2 * T, T)
    state = state_of(robot, np.zeros(robot.nv))
    for a in (100.0, 1.0, 2.0):
        predictor.command(np.full(robot.nv, a))
    np.testing.assert_allclose(predictor.predict(state).v, 3.0 * T)
    predictor.reset()
    np.testing.assert_array_equal(predictor.predict(state).v, 0.0)


def test_what_is_missing_counts_as_none_and_strange_states_come_back(robot):
    predictor = StatePredictor(robot, T, T)
    predictor.command(None)
    predictor.command(np.full(robot.nv, np.nan))
    state = state_of(robot, np.zeros(robot.nv))
    np.testing.assert_array_equal(predictor.predict(state).v, 0.0)
    other = poise.RobotState(np.zeros(3), np.zeros(3), {}, 0.0)
    assert predictor.predict(other) is other
    assert StatePredictor(robot, 0.0, T).predict(state) is state


@pytest.mark.parametrize(("delay", "period"), [(-T, T), (1.5 * T, T), (T, 0.0)])
def test_a_delay_that_is_no_whole_number_of_periods_is_refused(robot, delay, period):
    with pytest.raises(ConfigurationError, match="whole number"):
        StatePredictor(robot, delay, period)
