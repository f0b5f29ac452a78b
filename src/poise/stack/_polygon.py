"""Convex polygons in the plane, compiled: the outline of points, and the nearest point inside."""

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, part

_GRID = 2.0**-28
"""Points are taken to the nearest of a grid [m], on which no rounding decides what is a corner.

Corners of soles side by side are in line but for the last digit, and a chain that took three of
them for a line where they go there and back lost a foot's corner. Up to 4 m across, areas have 63
bits."""


@compiled
def find_hull(
    points: Float64[np.ndarray, "n 2"], count: int, hull: Float64[np.ndarray, "k 2"]
) -> int:
    """Andrew's monotone chain, exact on a grid of 4 nm; collinear points are left out."""
    x, y = (points[0, 0], points[0, 1]) if count > 0 else (0.0, 0.0)
    for i in range(count):
        points[i, 0] = round((points[i, 0] - x) / _GRID)
        points[i, 1] = round((points[i, 1] - y) / _GRID)
    n = _sort(points, count)
    if n < 3:
        return 0
    corners = start = 0
    # From left to right below all points, and back above them.
    for way in range(2 * n - 1):
        point = points[way if way < n else 2 * n - 2 - way]
        if way == n:
            start = corners - 1
        while corners > start + 1 and _turn(hull, corners, point) <= 0:
            corners -= 1
        hull[corners, 0], hull[corners, 1] = point[0], point[1]
        corners += 1
    for i in range(corners - 1):
        hull[i, 0], hull[i, 1] = x + _GRID * hull[i, 0], y + _GRID * hull[i, 1]
    return corners - 1


@part
def nearest_inside(hull: Float64[np.ndarray, "k 2"], x: float, y: float) -> tuple[float, float]:
    """The point itself where a polygon holds it, else the nearest of the outline."""
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
    """Sort by x, then y, and drops what is there twice; returns how many are left."""
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
def _turn(hull: Float64[np.ndarray, "k 2"], count: int, c: Float64[np.ndarray, "2"]) -> int:
    """Twice the area of the last two corners and a point, positive when it lies to their left."""
    a, b = hull[count - 2], hull[count - 1]
    return int(b[0] - a[0]) * int(c[1] - a[1]) - int(b[1] - a[1]) * int(c[0] - a[0])
