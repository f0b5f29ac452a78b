"""Convex polygons in the plane, compiled: the outline of points, and the nearest point inside."""

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, part

_STRAIGHT = 1e-12
"""Twice the area of three corners below which they lie on a line [m^2]."""


@compiled
def find_hull(
    points: Float64[np.ndarray, "n 2"], count: int, hull: Float64[np.ndarray, "k 2"]
) -> int:
    """Andrew's monotone chain; collinear points are left out.

    Args:
        points: sorted in place.
        count: how many there are.
        hull: receives the corners, counter-clockwise; room for twice as many.

    Returns:
        How many corners there are: none for fewer than three different points, two for a line.
    """
    n = _sort(points, count)
    if n < 3:
        return 0
    corners = start = 0
    # From left to right below all points, and back above them.
    for way in range(2 * n - 1):
        point = points[way if way < n else 2 * n - 2 - way]
        if way == n:
            start = corners - 1
        while corners > start + 1 and _turn(hull, corners, point) <= _STRAIGHT:
            corners -= 1
        hull[corners, 0], hull[corners, 1] = point[0], point[1]
        corners += 1
    return corners - 1


@part
def nearest_inside(hull: Float64[np.ndarray, "k 2"], x: float, y: float) -> tuple[float, float]:
    """The point itself where a polygon holds it, else the nearest of the outline.

    Args:
        hull: corners, counter-clockwise.
        x: the point [m].
        y: its second coordinate [m].
    """
    inside, least, near_x, near_y, count = True, np.inf, x, y, len(hull)
    for i in range(count):
        ax, ay = hull[i, 0], hull[i, 1]
        ex, ey = hull[(i + 1) % count, 0] - ax, hull[(i + 1) % count, 1] - ay
        if ex * (y - ay) - ey * (x - ax) < 0.0:
            inside = False
        along = (ex * (x - ax) + ey * (y - ay)) / (ex * ex + ey * ey)
        along = min(1.0, max(0.0, along))
        px, py = ax + along * ex, ay + along * ey
        square = (px - x) * (px - x) + (py - y) * (py - y)
        if square < least:
            least, near_x, near_y = square, px, py
    return (x, y) if inside else (near_x, near_y)


@part
def _sort(points: Float64[np.ndarray, "n 2"], count: int) -> int:
    """Sorts by x, then y, and drops what is there twice; returns how many are left."""
    kept = 0
    for i in range(count):
        x, y = points[i, 0], points[i, 1]
        place = kept
        while place > 0 and _is_before(x, y, points[place - 1]):
            place -= 1
        if place > 0 and points[place - 1, 0] == x and points[place - 1, 1] == y:
            continue
        for k in range(kept, place, -1):
            points[k, 0], points[k, 1] = points[k - 1, 0], points[k - 1, 1]
        points[place, 0], points[place, 1] = x, y
        kept += 1
    return kept


@part
def _is_before(x: float, y: float, b: Float64[np.ndarray, "2"]) -> bool:
    return bool(x < b[0] or (x == b[0] and y < b[1]))


@part
def _turn(hull: Float64[np.ndarray, "k 2"], count: int, c: Float64[np.ndarray, "2"]) -> float:
    """Twice the area of the last two corners and a point, positive when it lies to their left."""
    a, b = hull[count - 2], hull[count - 1]
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
