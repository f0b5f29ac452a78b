"""The quintic against its definition: ends, derivatives, and rates that carry over."""

import numpy as np
import pytest

from poise.apps.scenarios._director import Blend, Course

TIMES = np.linspace(1.01, 2.99, 50).tolist()


def test_a_blend_goes_from_zero_to_one_at_rest_at_both_ends():
    blend = Blend(1.0, 2.0)
    for time in (-5.0, 0.999, 1.0):
        assert blend.sample(time) == (0.0, 0.0, 0.0)
    for time in (3.0, 3.001, 99.0):
        assert blend.sample(time) == (1.0, 0.0, 0.0)
    assert blend.sample(2.0) == pytest.approx((0.5, 15.0 / 16.0, 0.0))
    assert not blend.done(2.999)
    assert blend.done(3.0)
    near_end = blend.sample(3.0 - 1e-6)
    assert near_end == pytest.approx((1.0, 0.0, 0.0), abs=1e-4)


def test_a_blends_rates_are_its_derivatives():
    blend, h = Blend(1.0, 2.0), 1e-5
    for t in TIMES:
        (before, v0, _), (_, rate, second), (after, v1, _) = map(blend.sample, (t - h, t, t + h))
        assert (after - before) / (2 * h) == pytest.approx(rate, abs=1e-8)
        assert (v1 - v0) / (2 * h) == pytest.approx(second, abs=1e-7)


@pytest.mark.parametrize("duration", [0.0, 1e-300, 1e-9])
def test_a_blend_of_no_length_is_a_step(duration):
    assert Blend(0.0, duration).sample(0.0) == (1.0, 0.0, 0.0)


def random_course(seed):
    start, way, velocity, acceleration = np.random.default_rng(seed).normal(size=(4, 3))
    return Course(Blend(1.0, 2.0), start, way, velocity, acceleration)


@pytest.mark.parametrize("seed", range(5))
def test_a_course_starts_with_the_rates_it_is_given_and_ends_at_rest(seed):
    course = random_course(seed)
    for got, wanted in zip(
        course.sample(1.0), (course.start, course.velocity, course.acceleration), strict=True
    ):
        np.testing.assert_allclose(got, wanted, atol=1e-12)
    for time in (3.0, 3.0 - 1e-9):
        position, velocity, acceleration = course.sample(time)
        np.testing.assert_allclose(position, course.goal, atol=1e-8)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-7)
        np.testing.assert_allclose(acceleration, 0.0, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_a_courses_rates_are_its_derivatives(seed):
    course, h = random_course(seed), 1e-5
    for t in TIMES:
        (before, v0, _), (_, rate, second), (after, v1, _) = map(course.sample, (t - h, t, t + h))
        np.testing.assert_allclose((after - before) / (2 * h), rate, atol=1e-8)
        np.testing.assert_allclose((v1 - v0) / (2 * h), second, atol=1e-7)
