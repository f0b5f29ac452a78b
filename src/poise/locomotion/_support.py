"""`SupportPolygon`: where the ZMP can be, and the nearest point of it.

`two_soles`: what a robot that walks stands on.
`sole_rectangle`, `convex_hull`, `signed_margin`: its corners, its outline, and distances to that.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled, part
from poise.errors import ConfigurationError
from poise.robots import Robot

Point = tuple[float, float]


class SupportPolygon:
    """Convex hull of the corners of soles, shrunk.

    Written for eight corners in a control tick: plain numbers are faster there than arrays.

    Args:
        corners: of the soles that carry [m].
        margin: how far the edge is taken inwards [m].
    """

    def __init__(self, corners: Sequence[Point], margin: float) -> None:
        self._edges = _inward_edges(convex_hull(corners), margin)

    def depth(self, point: Point) -> float:
        """How far a point is inside the shrunk polygon; negative outside [m]."""
        x, y = point
        inside = [nx * x + ny * y - c for nx, ny, c in self._edges]
        return min(inside) if inside else float("-inf")

    def nearest(self, point: Point) -> Point:
        """The point itself if it is inside, else the nearest of the edge."""
        edges = self._edges
        if not edges or self.depth(point) >= 0.0:
            return point
        corners = [_meet(a, b) for a, b in zip(edges[-1:] + edges[:-1], edges, strict=True)]
        best, least = point, float("inf")
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
            ex, ey = bx - ax, by - ay
            square = ex * ex + ey * ey
            along = ((point[0] - ax) * ex + (point[1] - ay) * ey) / square if square else 0.0
            along = min(1.0, max(0.0, along))
            near = (ax + along * ex, ay + along * ey)
            distance = (near[0] - point[0]) ** 2 + (near[1] - point[1]) ** 2
            if distance < least:
                best, least = near, distance
        return best

    def towards(self, start: Point, point: Point) -> Point:
        """The last point inside from a start that is inside towards a point; else the nearest."""
        (x, y), (ex, ey) = start, (point[0] - start[0], point[1] - start[1])
        ratio = 1.0
        for nx, ny, c in self._edges:
            inside, rate = nx * x + ny * y - c, nx * ex + ny * ey
            if inside < 0.0:
                return self.nearest(point)
            if rate < 0.0:
                ratio = min(ratio, -inside / rate)
        return (x + ratio * ex, y + ratio * ey)


def two_soles(robot: Robot) -> tuple[str, str]:
    """Names of the left and the right sole of a robot that walks.

    Raises:
        ConfigurationError: it has no floating base, or does not stand on two soles.
    """
    if not robot.floating_base or len(robot.soles) != 2:
        raise ConfigurationError(
            f"robot {robot.name!r} cannot walk on two feet",
            got=f"soles {list(robot.soles)}",
            wanted="a floating base and two soles",
        )
    left, right = robot.soles
    return left, right


def sole_rectangle(
    position: Float64[np.ndarray, "3"], rotation: Float64[np.ndarray, "3 3"], size: Point
) -> list[Point]:
    """Corners of a sole, seen from above [m].

    Args:
        position: of its centre [m].
        rotation: world_R_sole.
        size: length and width [m].
    """
    (forward_x, left_x, _), (forward_y, left_y, _), _ = rotation.tolist()
    ax, ay = 0.5 * size[0] * forward_x, 0.5 * size[0] * forward_y
    bx, by = 0.5 * size[1] * left_x, 0.5 * size[1] * left_y
    x, y, _ = position.tolist()
    return [
        (x + ax + bx, y + ay + by),
        (x - ax + bx, y - ay + by),
        (x - ax - bx, y - ay - by),
        (x + ax - bx, y + ay - by),
    ]


def convex_hull(points: Iterable[Point]) -> list[Point]:
    """Andrew's monotone chain, counter-clockwise; collinear points are left out.

    Args:
        points: any number; fewer than three different ones have no hull.
    """
    array = np.array([*points], dtype=np.float64).reshape(-1, 2)
    hull = np.empty((2 * len(array), 2))
    count = _find_hull(array, np.empty(len(array), dtype=np.int64), hull)
    return [(x, y) for x, y in hull[:count].tolist()]


def signed_margin(
    points: Float64[np.ndarray, "n 2"], vertices: Float64[np.ndarray, "k 2"]
) -> Float64[np.ndarray, " n"]:
    """Distance of points to the boundary of a convex polygon, positive inside [m].

    Args:
        points: the points [m].
        vertices: corners in order around the polygon, either way round [m].

    Returns:
        Distances [m]; NaN for a NaN point, and for a polygon without corners. One or two corners
        make a point or a line, of which everything is outside.
    """
    if len(vertices) == 0:
        return np.full(len(points), np.nan)
    edge = np.roll(vertices, -1, axis=0) - vertices  # [m]
    offset = points[:, None, :] - vertices[None, :, :]
    length2 = np.maximum(np.sum(edge**2, axis=1), 1e-18)  # [m^2]
    along = np.clip(np.sum(offset * edge, axis=2) / length2, 0.0, 1.0)
    distance = np.linalg.norm(offset - along[:, :, None] * edge, axis=2).min(axis=1)
    side = edge[:, 0] * offset[:, :, 1] - edge[:, 1] * offset[:, :, 0]  # [m^2]
    inside = (side >= 0.0).all(axis=1) | (side <= 0.0).all(axis=1)
    flat = len(vertices) < 3
    return np.where(inside & (not flat), distance, -distance)


def _inward_edges(vertices: list[Point], margin: float) -> list[tuple[float, float, float]]:
    """Inward unit normal and offset of each edge, moved inwards."""
    edges: list[tuple[float, float, float]] = []
    for (ax, ay), (bx, by) in zip(vertices, vertices[1:] + vertices[:1], strict=True):
        nx, ny = ay - by, bx - ax
        length = math.hypot(nx, ny)
        nx, ny = nx / length, ny / length
        edges.append((nx, ny, nx * ax + ny * ay + margin))
    return edges


def _meet(a: tuple[float, float, float], b: tuple[float, float, float]) -> Point:
    """Where two edges' lines meet."""
    det = a[0] * b[1] - a[1] * b[0]
    return ((a[2] * b[1] - a[1] * b[2]) / det, (a[0] * b[2] - a[2] * b[0]) / det)


@compiled
def _find_hull(
    points: Float64[np.ndarray, "n 2"],
    order: Int64[np.ndarray, " n"],
    hull: Float64[np.ndarray, "2*n 2"],
) -> int:
    """Writes the hull's corners and returns how many they are.

    Args:
        points: any number.
        order: scratch: the points from left to right.
        hull: receives the corners, counter-clockwise.
    """
    n = _sort(points, order)
    if n < 3:
        return 0
    count = start = 0
    # From left to right below all points, and back above them.
    for way in range(2 * n - 1):
        point = points[order[way if way < n else 2 * n - 2 - way]]
        if way == n:
            start = count - 1
        while count > start + 1 and _turn(hull[count - 2], hull[count - 1], point) <= _STRAIGHT:
            count -= 1
        hull[count, 0], hull[count, 1] = point[0], point[1]
        count += 1
    return count - 1


_STRAIGHT = 1e-12
"""Twice the area of three corners below which they lie on a line [m^2]."""


@part
def _sort(points: Float64[np.ndarray, "n 2"], order: Int64[np.ndarray, " n"]) -> int:
    """Indices of different points by x, then y; returns how many."""
    count = 0
    for i in range(len(points)):
        place = count
        while place > 0 and _is_before(points[i], points[order[place - 1]]):
            place -= 1
        if place > 0 and not _is_before(points[order[place - 1]], points[i]):
            continue
        for k in range(count, place, -1):
            order[k] = order[k - 1]
        order[place] = i
        count += 1
    return count


@part
def _is_before(a: Float64[np.ndarray, "2"], b: Float64[np.ndarray, "2"]) -> bool:
    return bool(a[0] < b[0] or (a[0] == b[0] and a[1] < b[1]))


@part
def _turn(
    a: Float64[np.ndarray, "2"], b: Float64[np.ndarray, "2"], c: Float64[np.ndarray, "2"]
) -> float:
    """Twice the area of a triangle, positive when its corners go counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
