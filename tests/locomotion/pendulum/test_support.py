"""The support polygon: corners, outline, how far inside a point is, where it is moved to."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from poise.locomotion import SupportPolygon, convex_hull, signed_margin, sole_rectangle

CORNERS = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)]


def as_set(points):
    return {tuple(p) for p in np.round(points, 9).tolist()}


def are_the_same(found, expected):
    """In any order, up to the grid of 4 nm on which hulls are exact."""
    found, expected = (np.array(sorted(np.round(p, 7).tolist())) for p in (found, expected))
    return found.shape == expected.shape and np.allclose(found, expected, rtol=0.0, atol=1.1e-7)


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def test_a_sole_has_its_corners_where_it_is_turned_to():
    corners = sole_rectangle(np.array([1.0, 2.0, 0.0]), np.eye(3), (0.2, 0.1))
    assert as_set(corners) == {(1.1, 2.05), (0.9, 2.05), (0.9, 1.95), (1.1, 1.95)}
    corners = sole_rectangle(np.array([1.0, 2.0, 0.3]), turned(np.pi / 2), (0.2, 0.1))
    assert as_set(corners) == {(1.05, 2.1), (1.05, 1.9), (0.95, 1.9), (0.95, 2.1)}


@pytest.mark.parametrize("seed", range(3))
def test_the_hull_is_qhulls_counter_clockwise(seed):
    points = np.random.default_rng(seed).normal(size=(9, 2))
    hull = np.array(convex_hull([tuple(p) for p in points.tolist()]))
    assert are_the_same(hull, points[ConvexHull(points).vertices])
    edge = np.roll(hull, -1, axis=0) - hull
    after = np.roll(edge, -1, axis=0)
    assert (edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0] > 0.0).all()


def test_points_on_a_line_and_points_inside_are_no_corners_of_the_hull():
    inside = [(1.0, 0.0), (2.0, 0.5), (0.7, 0.3), (0.0, 0.0)]
    assert as_set(convex_hull(CORNERS + inside)) == as_set(CORNERS)
    assert convex_hull([(0.0, 0.0), (1.0, 1.0)]) == []


def test_the_margin_takes_the_edge_inwards():
    square = SupportPolygon(CORNERS, 0.2)
    assert square.depth((1.0, 0.5)) == pytest.approx(0.3)
    assert square.depth((0.3, 0.5)) == pytest.approx(0.1)
    assert square.depth((0.1, 0.5)) == pytest.approx(-0.1)
    assert square.nearest((-5.0, 0.5)) == pytest.approx((0.2, 0.5))
    assert square.nearest((5.0, 5.0)) == pytest.approx((1.8, 0.8))
    assert square.towards((1.0, 0.5), (1.0, 2.0)) == pytest.approx((1.0, 0.8))


def test_towards_keeps_the_direction_where_nearest_does_not():
    square = SupportPolygon(CORNERS, 0.0)
    assert square.towards((0.5, 0.5), (1.5, 0.9)) == (1.5, 0.9)
    # Half of the way to y = 1.5 reaches the edge at y = 1.
    assert square.towards((0.5, 0.5), (2.5, 1.5)) == pytest.approx((1.5, 1.0))
    assert square.nearest((2.5, 1.5)) == pytest.approx((2.0, 1.0))
    # From outside there is no way inside: the nearest point.
    assert square.towards((-1.0, 0.5), (2.5, 0.5)) == pytest.approx((2.0, 0.5))


@pytest.mark.parametrize("seed", range(3))
def test_nearest_and_depth_agree_with_a_densely_sampled_edge(seed):
    """Of a polygon with edges in all directions, away from the origin."""
    rng = np.random.default_rng(seed)
    corners = 0.3 * rng.normal(size=(8, 2)) + [2.0, -1.0]
    polygon, edge = SupportPolygon([tuple(c) for c in corners.tolist()], 0.0), []
    hull = np.array(convex_hull([tuple(c) for c in corners.tolist()]))
    for a, b in zip(hull, np.roll(hull, -1, axis=0), strict=True):
        edge.append(a + np.linspace(0.0, 1.0, 2001)[:, None] * (b - a))
    edge = np.concatenate(edge)
    for point in 1.5 * rng.normal(size=(20, 2)) + [2.0, -1.0]:
        x, y = polygon.nearest(tuple(point.tolist()))
        away = np.linalg.norm(edge - point, axis=1)
        if polygon.depth((float(point[0]), float(point[1]))) >= 0.0:
            assert (x, y) == tuple(point)
        else:
            assert math.hypot(x - point[0], y - point[1]) == pytest.approx(away.min(), abs=1e-3)
            assert np.linalg.norm(edge - [x, y], axis=1).min() < 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_margin_equals_the_distance_to_a_densely_sampled_boundary(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(9, 2))
    corners = points[ConvexHull(points).vertices]
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
    # Inside, it is how deep a support polygon of these corners has the point.
    polygon = SupportPolygon([tuple(c) for c in corners.tolist()], 0.0)
    depths = [polygon.depth(tuple(p)) for p in points[inside].tolist()]
    np.testing.assert_allclose(signed_margin(points[inside], corners), depths, atol=4e-9)


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
