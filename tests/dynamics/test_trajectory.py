"""Least-jerk motions against their definition: ends, derivatives, and rates that carry over."""

import numpy as np
import pytest

from poise.dynamics import Quintic, least_jerk

START, DURATION = 1.0, 2.0
TIMES = np.linspace(1.01, 2.99, 50).tolist()


def phase(time):
    return least_jerk(time, START, DURATION)


def test_the_phase_goes_from_zero_to_one_at_rest_at_both_ends():
    for time in (-5.0, 0.999, 1.0):
        assert phase(time) == (0.0, 0.0, 0.0)
    for time in (3.0, 3.001, 99.0):
        assert phase(time) == (1.0, 0.0, 0.0)
    assert phase(2.0) == pytest.approx((0.5, 15.0 / 16.0, 0.0))
    assert phase(1.0 + 1e-6) == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)
    assert phase(3.0 - 1e-6) == pytest.approx((1.0, 0.0, 0.0), abs=1e-4)


def test_the_phases_rates_are_its_derivatives():
    h = 1e-5
    for t in TIMES:
        (before, v0, _), (_, rate, second), (after, v1, _) = map(phase, (t - h, t, t + h))
        assert (after - before) / (2 * h) == pytest.approx(rate, abs=1e-8)
        assert (v1 - v0) / (2 * h) == pytest.approx(second, abs=1e-7)


@pytest.mark.parametrize("duration", [0.0, 1e-300, 1e-9])
def test_a_motion_of_no_length_is_a_step(duration):
    assert least_jerk(-0.1, 0.0, duration) == (0.0, 0.0, 0.0)
    assert least_jerk(0.0, 0.0, duration) == (1.0, 0.0, 0.0)
    step = Quintic(start=0.0, duration=duration, position=np.zeros(2), goal=np.ones(2))
    assert step.is_over(0.0)
    np.testing.assert_array_equal(step.sample(0.0), [[1.0, 1.0], [0.0, 0.0], [0.0, 0.0]])


def random_quintic(seed):
    position, goal, velocity, acceleration = np.random.default_rng(seed).normal(size=(4, 3))
    return Quintic(
        start=START,
        duration=DURATION,
        position=position,
        goal=goal,
        velocity=velocity,
        acceleration=acceleration,
    )


@pytest.mark.parametrize("seed", range(5))
def test_a_quintic_starts_with_the_rates_it_is_given_and_ends_at_rest(seed):
    motion = random_quintic(seed)
    given = (motion.position, motion.velocity, motion.acceleration)
    for got, wanted in zip(motion.sample(1.0), given, strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-12)
    assert not motion.is_over(2.999)
    assert motion.is_over(3.0)
    for time in (3.0, 3.0 - 1e-9):
        position, velocity, acceleration = motion.sample(time)
        np.testing.assert_allclose(position, motion.goal, atol=1e-8)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-7)
        np.testing.assert_allclose(acceleration, 0.0, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_a_quintics_rates_are_its_derivatives(seed):
    motion, h = random_quintic(seed), 1e-5
    for t in TIMES:
        (before, v0, _), (_, rate, second), (after, v1, _) = map(motion.sample, (t - h, t, t + h))
        np.testing.assert_allclose((after - before) / (2 * h), rate, atol=1e-8)
        np.testing.assert_allclose((v1 - v0) / (2 * h), second, atol=1e-7)


def test_a_quintic_from_rest_has_the_phase_of_least_jerk():
    motion = Quintic(start=START, duration=DURATION, position=np.zeros(1), goal=np.ones(1))
    for t in TIMES:
        np.testing.assert_allclose(np.ravel(motion.sample(t)), phase(t), atol=1e-13)
