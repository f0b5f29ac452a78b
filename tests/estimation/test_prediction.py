"""States carried on over the delay of the sensors."""

import numpy as np
import pinocchio as pin
import pytest

import poise
from poise.errors import ConfigurationError
from poise.estimation import StampedPredictor, StatePredictor

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


@pytest.mark.parametrize(
    ("delay", "period"), [(-T, T), (1.5 * T, T), (T, 0.0), (np.nan, T), (np.inf, T), (T, np.nan)]
)
def test_a_delay_that_is_no_whole_number_of_periods_is_refused(robot, delay, period):
    with pytest.raises(ConfigurationError, match="whole number"):
        StatePredictor(robot, delay, period)


def test_stamps_and_clock_say_how_late_a_state_is(robot):
    random = np.random.default_rng(1)
    by_stamps, by_delay = StampedPredictor(robot), StatePredictor(robot, 5 * T, T)
    state = state_of(robot, random.normal(size=robot.nv, scale=0.5))
    # It was measured when the fourth of nine commands began to act.
    for i, a in enumerate(random.normal(size=(9, robot.nv), scale=5.0)):
        by_stamps.command(a, 1.0 + (i - 4) * T)
        by_delay.command(a)
    found, expected = by_stamps.predict(state), by_delay.predict(state)
    np.testing.assert_allclose(found.q, expected.q, atol=1e-12)
    np.testing.assert_allclose(found.v, expected.v, atol=1e-12)
    assert found.time == pytest.approx(1.0 + 5 * T)


def test_a_state_that_is_not_late_stays_as_it_is(robot):
    predictor = StampedPredictor(robot)
    state = state_of(robot, np.ones(robot.nv))
    assert predictor.predict(state) is state
    for i in range(3):
        predictor.command(np.ones(robot.nv), 1.0 + (i - 3) * T)
    assert predictor.predict(state) is state


@pytest.mark.parametrize("time", [0.9, 1.2, np.nan])
def test_commands_before_a_pause_or_a_clock_that_jumps_do_not_count(robot, time):
    predictor = StampedPredictor(robot)
    for i in range(20):
        predictor.command(np.full(robot.nv, 100.0), 1.0 + i * T)
    predictor.command(np.full(robot.nv, 1.0), time)
    predictor.command(None, time + T)
    state = state_of(robot, np.zeros(robot.nv))
    late = poise.RobotState(state.q, state.v, {}, time)
    found = predictor.predict(late).v
    np.testing.assert_allclose(found, 0.0 if np.isnan(time) else T, atol=1e-12)


def test_however_late_a_state_is_it_goes_on_by_fifty_milliseconds_at_most(robot):
    predictor = StampedPredictor(robot)
    for i in range(200):
        predictor.command(np.ones(robot.nv), i * T)
    state = state_of(robot, np.zeros(robot.nv))
    old = poise.RobotState(state.q, state.v, {}, 0.0)
    np.testing.assert_allclose(predictor.predict(old).v, 25 * T)
    other = poise.RobotState(np.zeros(3), np.zeros(3), {}, 0.0)
    assert predictor.predict(other) is other


def test_a_share_of_what_was_commanded_may_count(robot):
    predictor = StampedPredictor(robot, 0.5)
    for i in range(4):
        predictor.command(np.full(robot.nv, 2.0), 1.0 + i * T)
    found = predictor.predict(state_of(robot, np.zeros(robot.nv)))
    np.testing.assert_allclose(found.v, 4.0 * T)
    with pytest.raises(ConfigurationError, match="share"):
        StampedPredictor(robot, 1.5)
