"""The support polygon: where a point outside is brought back to."""

import pytest

from poise.locomotion._support import SupportPolygon


def test_towards_keeps_the_direction_where_nearest_does_not():
    square = SupportPolygon([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)], 0.0)
    assert square.towards((0.5, 0.5), (1.5, 0.9)) == (1.5, 0.9)
    # Half of the way to y = 1.5 reaches the edge at y = 1.
    assert square.towards((0.5, 0.5), (2.5, 1.5)) == pytest.approx((1.5, 1.0))
    assert square.nearest((2.5, 1.5)) == pytest.approx((2.0, 1.0))
    # From outside there is no way inside: the nearest point.
    assert square.towards((-1.0, 0.5), (2.5, 0.5)) == pytest.approx((2.0, 0.5))
