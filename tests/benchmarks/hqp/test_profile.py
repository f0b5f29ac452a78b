"""Performance profiles: numbers of a table of times made by hand, and the picture of a race."""

import numpy as np
import pytest

from benchmarks.hqp.figure import make_profiles, profiles_of, write_profile_figure
from benchmarks.hqp.race import COLD, WARM, Lap

SECONDS = {
    "a": np.array([1.0, 2.0, 4.0, 9.0]),
    "b": np.array([2.0, 2.0, 1.0, 9.0]),
    "c": np.array([0.5, 9.0, 8.0, 9.0]),
}
SOLVED = {
    "a": np.array([True, True, True, False]),
    "b": np.array([True, True, True, False]),
    "c": np.array([False, False, True, False]),
}
"""The quickest right answers take 1, 2, 1; c is wrong where it is quickest; the last beats all."""


def test_shares_are_those_of_the_table():
    a, b, c = make_profiles(SECONDS, SOLVED)
    np.testing.assert_array_equal(a.factors, [1.0, 1.0, 4.0])
    np.testing.assert_array_equal(b.factors, [1.0, 1.0, 2.0])
    np.testing.assert_array_equal(c.factors, [8.0])
    assert [a.at(factor) for factor in (1.0, 3.9, 4.0, np.inf)] == [0.5, 0.5, 0.75, 0.75]
    assert [b.at(factor) for factor in (1.0, 1.9, 2.0)] == [0.5, 0.5, 0.75]
    assert [c.at(factor) for factor in (1.0, 7.9, 8.0)] == [0.0, 0.0, 0.25]


def lap(method, sequence, seconds, right, start=COLD):
    count = len(seconds)
    return Lap(
        sequence=sequence,
        family="random",
        method=method,
        start=start,
        seconds=np.array(seconds),
        claimed=np.ones(count, dtype=np.bool_),
        right=np.array(right),
        gaps=np.zeros(count),
        cost_gaps=np.zeros(count),
        statuses=count * ("optimal",),
    )


def test_the_figure_is_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    laps = [
        lap(method, name, seconds, [True], start)
        for name, start in (("one", COLD), ("two", COLD), ("two", WARM))
        for method, seconds in (("direct", [1.0]), ("b", [2.0]))
    ]
    direct, other = profiles_of(laps, COLD)
    assert (direct.at(1.0), other.at(1.0), other.at(2.0)) == (1.0, 0.0, 1.0)
    path = write_profile_figure(laps, tmp_path / "hqp.png")
    assert path.read_bytes().startswith(b"\x89PNG")
