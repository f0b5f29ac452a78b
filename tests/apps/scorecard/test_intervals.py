"""Medians and shares, and whether their intervals hold what they say."""

import numpy as np
import pytest

from poise.apps.scorecard._intervals import median_of, share_of


def test_the_median_of_few_has_the_ends_and_says_how_little_that_is():
    found = median_of([0.3, 0.1, 0.2])
    assert (found.value, found.low, found.high) == (0.2, 0.1, 0.3)
    assert found.confidence == pytest.approx(1 - 2 / 8)
    assert median_of([0.4]).confidence == 0.0


def test_the_median_of_ten_has_the_second_and_the_ninth():
    found = median_of([float(i) for i in range(1, 11)])
    assert (found.value, found.low, found.high) == (5.5, 2.0, 9.0)
    assert found.confidence == pytest.approx(1 - 2 * 11 / 1024)


def test_as_many_intervals_as_they_say_hold_the_median():
    rng = np.random.default_rng(1)
    found = [median_of(rng.lognormal(size=12).tolist()) for _ in range(2000)]
    held = np.mean([one.low <= 1.0 <= one.high for one in found])
    assert found[0].confidence >= 0.95
    assert held == pytest.approx(found[0].confidence, abs=0.015)


def test_a_share_has_wilsons_interval():
    found = share_of(8, 10)
    assert found.value == 0.8
    assert (found.low, found.high) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert share_of(0, 8).low == 0.0
    assert share_of(8, 8).high == 1.0
    assert 0.5 < share_of(8, 8).low < 1.0
