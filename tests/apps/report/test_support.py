import numpy as np
import pytest
from synthetic_run import hull, rectangle, walking_record

from poise.apps.report import SupportPhase
from poise.apps.report._plots._zmp import signed_margin, support_over_time


@pytest.mark.parametrize("seed", range(6))
def test_margin_equals_the_distance_to_a_densely_sampled_boundary(seed):
    rng = np.random.default_rng(seed)
    corners = hull(rng.normal(size=(9, 2)))
    if seed % 2:
        corners = corners[::-1]
    points = 1.5 * rng.normal(size=(60, 2))
    steps = np.linspace(0, 1, 4001)[:, None]
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    boundary = np.concatenate([a + steps * (b - a) for a, b in sides])
    distance = np.array([np.linalg.norm(boundary - p, axis=1).min() for p in points])
    # Inside a polygon the directions to its corners turn once around; outside they do not.
    inside = [abs(winding(p, corners)) > 0.5 for p in points]
    expected = np.where(inside, distance, -distance)
    np.testing.assert_allclose(signed_margin(points, corners), expected, atol=2e-3)
    assert any(inside)
    assert not all(inside)


def winding(point, corners):
    angle = np.arctan2(*(corners - point).T[::-1])
    turn = np.diff(np.append(angle, angle[0]))
    return ((turn + np.pi) % (2 * np.pi) - np.pi).sum() / (2 * np.pi)


def test_nothing_is_inside_a_line_or_a_point():
    points = np.array([[0.0, 0.0], [0.5, 0.2]])
    line = np.array([[-1.0, 0.0], [1.0, 0.0]])
    np.testing.assert_allclose(signed_margin(points, line), [0.0, -0.2], atol=1e-12)
    np.testing.assert_allclose(signed_margin(points, line[:1]), [-1.0, -np.hypot(1.5, 0.2)])
    assert np.isnan(signed_margin(points, np.zeros((0, 2)))).all()


def test_bounds_follow_the_phases_and_are_missing_in_flight():
    record = walking_record(
        duration=2.0,
        support=(
            SupportPhase(start=0.0, end=0.5, vertices=rectangle(0.0, 0.0)),
            SupportPhase(start=0.5, end=1.0, vertices=np.zeros((0, 2))),
            SupportPhase(start=1.0, end=2.0, vertices=rectangle(1.0, 0.0)),
        ),
    )
    low, high, margin = support_over_time(record)
    first, flight = record.time < 0.5, (record.time >= 0.5) & (record.time < 1.0)
    np.testing.assert_allclose(low[first], np.tile([-0.12, -0.06], (first.sum(), 1)))
    np.testing.assert_allclose(high[record.time >= 1.0, 0], 1.12)
    assert np.isnan(low[flight]).all()
    assert np.isnan(margin[flight]).all()
    assert np.isfinite(margin[~flight]).all()
