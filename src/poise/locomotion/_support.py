"""Regions of the ZMP: support polygons, loaded parts of soles, and single support on one foot."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import find_hull

Point = tuple[float, float]
Vector2 = Float64[np.ndarray, "2"]
Vector3 = Float64[np.ndarray, "3"]
Rotation = Float64[np.ndarray, "3 3"]


class SupportPolygon:
    """Convex hull of the corners of soles, shrunk."""

    def __init__(self, corners: Sequence[Point], margin: float) -> None:
        points = convex_hull(corners)
        # Inward unit normal and offset of each edge, counter-clockwise.
        self._edges: list[list[float]] = []
        for (ax, ay), (bx, by) in zip(points, points[1:] + points[:1], strict=True):
            nx, ny = ay - by, bx - ax
            length = math.sqrt(nx * nx + ny * ny)
            nx, ny = nx / length, ny / length
            self._edges.append([nx, ny, nx * ax + ny * ay + margin])

    def depth(self, point: Point) -> float:
        """Return the depth of a point inside the shrunk polygon; negative outside [m]."""
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
    """Names of the left and the right sole of a robot that walks."""
    if not robot.floating_base or len(robot.soles) != 2:
        raise ConfigurationError(
            f"robot {robot.name!r} cannot walk on two feet",
            got=f"soles {list(robot.soles)}",
            wanted="a floating base and two soles",
        )
    left, right = robot.soles
    return left, right


def sole_rectangle(position: Vector3, rotation: Rotation, size: Point) -> list[Point]:
    """Corners of a sole, projected on the horizontal plane [m]."""
    return SolePart(0.0, 0.0, *size).corners(position, rotation, 0.0)


_THIN = 0.002
"""Least width of the loaded part of a sole: that of an edge [m]."""


_MIDDLE = 0.1
"""Distance of the ZMP's rest from the middle of what bears at most, over its size: in the centre of
a sole of which an edge is out of a strong ankle's reach."""


class SolePart(NamedTuple):
    """A rectangle in a sole on which it carries, or in which the ZMP can be."""

    x: float  # of its middle, along the sole's axes from the sole's centre [m]
    y: float  # the same [m]
    length: float  # along x [m]
    width: float  # along y [m]; zero on an edge

    def corners(self, position: Vector3, rotation: Rotation, margin: float) -> list[Point]:
        """Its horizontal corners, shrunk by the margin as far as possible [m]."""
        size = (max(self.length - 2.0 * margin, _THIN), max(self.width - 2.0 * margin, _THIN))
        (forward_x, left_x, _), (forward_y, left_y, _), _ = rotation.tolist()
        ax, ay = 0.5 * size[0] * forward_x, 0.5 * size[0] * forward_y
        bx, by = 0.5 * size[1] * left_x, 0.5 * size[1] * left_y
        x, y, _ = position.tolist()
        x, y = x + self.x * forward_x + self.y * left_x, y + self.x * forward_y + self.y * left_y
        return [
            (x + ax + bx, y + ay + by),
            (x - ax + bx, y - ay + by),
            (x - ax - bx, y - ay - by),
            (x + ax - bx, y + ay - by),
        ]

    @property
    def rest(self) -> Point:
        """Rest of the ZMP: near its middle, on the side of the sole's centre [m]."""
        x, y = _MIDDLE * self.length, _MIDDLE * self.width
        return min(max(0.0, self.x - x), self.x + x), min(max(0.0, self.y - y), self.y + y)

    @property
    def room(self) -> Point:
        """Distance that the ZMP can go from there either way, along x and y [m]."""
        x, y = self.rest
        return 0.5 * self.length - abs(x - self.x), 0.5 * self.width - abs(y - self.y)

    def rest_at(self, position: Point, yaw: float) -> Point:
        """Return the rest of the ZMP in the world, on a sole that lies there [m]."""
        (ahead, left), c, s = self.rest, math.cos(yaw), math.sin(yaw)
        return position[0] + c * ahead - s * left, position[1] + s * ahead + c * left

    def within(self, lower: Point, upper: Point) -> "SolePart":
        """Return its part in another rectangle; the nearest edge or corner where there is none."""
        ends = zip(self[:2], self[2:], lower, upper, strict=True)
        (x, length), (y, width) = (_common(*axis) for axis in ends)
        return SolePart(x, y, length, width)


def _common(middle: float, size: float, lower: float, upper: float) -> tuple[float, float]:
    """Middle and size of the intersection of two intervals [m]."""
    low, high = middle - 0.5 * size, middle + 0.5 * size
    begin, end = min(max(lower, low), high), min(max(upper, low), high)
    return 0.5 * (begin + end), end - begin


def both_soles(
    placements: Sequence[tuple[Vector3, Rotation]],
    sizes: Sequence[Point],
    margin: float,
    parts: Sequence[SolePart | None] = (None, None),
) -> SupportPolygon:
    """Return the support polygon of two feet."""
    if all(part is None for part in parts):
        rows = zip(placements, sizes, strict=True)
        return SupportPolygon([c for p, size in rows for c in sole_rectangle(*p, size)], margin)
    # A part may be narrower than its margins: each is shrunk by itself.
    corners: list[Point] = []
    for placement, size, part in zip(placements, sizes, parts, strict=True):
        corners += (part or SolePart(0.0, 0.0, *size)).corners(*placement, margin)
    return SupportPolygon(corners, 0.0)


def convex_hull(points: Iterable[Point]) -> list[Point]:
    """Andrew's monotone chain, counter-clockwise; collinear points are left out."""
    array = np.array([*points], dtype=np.float64).reshape(-1, 2)
    hull = np.empty((2 * len(array), 2))
    count = find_hull(array, len(array), hull)
    return [(x, y) for x, y in hull[:count].tolist()]


def soles_outline(
    robot: Robot, placements: Mapping[str, tuple[Vector3, Rotation]]
) -> Float64[np.ndarray, "h 2"]:
    """Corners of the horizontal convex hull of soles, counter-clockwise [m]."""
    corners: list[Point] = []
    for name, placement in placements.items():
        sole = robot.soles[name]
        corners += sole_rectangle(*placement, (sole.length, sole.width))
    return np.array(convex_hull(corners)).reshape(-1, 2)


def signed_margin(
    points: Float64[np.ndarray, "n 2"], vertices: Float64[np.ndarray, "k 2"]
) -> Float64[np.ndarray, " n"]:
    """Distance of points to the boundary of a convex polygon, positive inside [m]."""
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


def _meet(a: Sequence[float], b: Sequence[float]) -> Point:
    """Return the intersection of two edges' lines."""
    det = a[0] * b[1] - a[1] * b[0]
    return ((a[2] * b[1] - a[1] * b[2]) / det, (a[0] * b[2] - a[2] * b[0]) / det)


_PUSH, _INWARDS_MAX = 0.2, 0.65
"""Outward push that one foot is to hold [m/s], and how far beside the middle of the sole the ZMP
may rest for that, over half its width."""

_STRAY = 0.013
"""Deviation of the DCM from its reference on bumps, with attitude error and sensor noise [m]."""

_OUTER, _ASKED = 0.0275, 0.0525
"""Distance beyond a narrow sole's outer edge up to which angular momentum holds the DCM, and the
distance beyond it of the CT-ZMP commanded then [m]."""

_MOMENTUM = 0.01
"""The latter for any other sole [m]."""

_INNER_MARGIN = 0.006
"""Distance of the CT-ZMP from a narrow sole's inner edge: contacts keep the pressure some
millimetres from it, and what is asked beyond leans the trunk [m]."""

_ARRIVING = 0.6
"""Part of the inward rest for which a weight shift aims; the rest brakes what the swing adds."""

_ANNOUNCED = 0.7
"""Inward shift of the stance sole that the balance limit takes as a foothold, over the inward rest
of the ZMP."""


@dataclass(frozen=True, kw_only=True)
class SingleSupportRegion:
    """Rest of the ZMP and limits of DCM and CT-ZMP while one foot carries the robot."""

    # A push inwards is caught by the swing foot, one outwards would have to cross the stance leg:
    # the ZMP rests on the inner side of a narrow sole, and angular momentum makes up for the rest.

    sizes: tuple[Point, Point]  # length and width of the left and of the right sole [m]
    margin: float  # distance from the soles' edges at which support ends [m]
    arrived: float  # distance of the DCM from its rest at which a weight shift is complete [m]
    inwards: float = 0.0  # distance of the ZMP's rest from the sole's middle, inwards [m]
    inner: float = 0.0  # distance beyond the inner edge of support at which the robot steps [m]
    outer: float = 0.0  # distance beyond the outer edge at which it does [m]
    momentum: float = _MOMENTUM  # distance beyond the sole's outer edge of the CT-ZMP [m]
    narrow: bool = False  # too narrow for a push outwards wherever the ZMP rests

    def rest(self, foot: int, place: Vector3, rotation: Rotation, share: float = 1.0) -> Point:
        """Return the rest of the ZMP on a foot that carries alone [m]."""
        (x, y, _), (along_x, along_y) = place.tolist(), rotation[:2, 1].tolist()
        left = -side(foot) * share * self.inwards
        return x + left * along_x, y + left * along_y

    def arriving(self, foot: int, place: Vector3, rotation: Rotation) -> Point:
        """Return the goal of the ZMP in a weight shift to a foot, further outwards [m]."""
        return self.rest(foot, place, rotation, _ARRIVING)

    def support(self, foot: int, place: Vector3, rotation: Rotation) -> SupportPolygon:
        """Return the sole, less the margin."""
        return SupportPolygon(self._widened(foot).corners(place, rotation, 0.0), self.margin)

    def held(self, foot: int, place: Vector3, rotation: Rotation) -> SupportPolygon:
        """Return where the DCM is held."""
        part = self._widened(foot, self.inner, self.outer)
        return SupportPolygon(part.corners(place, rotation, 0.0), self.margin)

    def asked(self, foot: int, place: Vector3, rotation: Rotation) -> SupportPolygon:
        """Return the region of the CT-ZMP: beyond the outer edge of a narrow sole only."""
        inner = -_INNER_MARGIN if self.narrow else _MOMENTUM
        part = self._widened(foot, inner, self.momentum, _MOMENTUM)
        return SupportPolygon(part.corners(place, rotation, 0.0), 0.0)

    def caught(self, foot: int, place: Vector3, rotation: Rotation) -> list[Point] | None:
        """Return corners of the foothold that a swing foot offers beside a narrow sole [m]."""
        if not self.narrow:
            return None
        part = SolePart(0.0, -side(foot) * _ANNOUNCED * self.inwards, *self.sizes[foot])
        return part.corners(place, rotation, 0.0)

    def _widened(
        self, foot: int, inner: float = 0.0, outer: float = 0.0, along: float = 0.0
    ) -> SolePart:
        (length, width), middle = self.sizes[foot], -0.5 * side(foot) * (inner - outer)
        return SolePart(0.0, middle, length + 2.0 * along, width + inner + outer)


def single_support_region(robot: Robot, omega: float, margin: float) -> SingleSupportRegion:
    """Return the region of a robot, by the width of its soles."""
    left, right = ((sole.length, sole.width) for sole in robot.soles.values())
    half = 0.5 * min(left[1], right[1])
    plain = SingleSupportRegion(
        sizes=(left, right), margin=margin, arrived=0.25 * min(*left, *right)
    )
    missing = _PUSH / omega + margin - half
    inwards = _INWARDS_MAX * half
    if missing <= 0.0:
        return plain
    if missing <= inwards:
        return replace(plain, inwards=missing)
    return replace(
        plain,
        # Nearer to the inner edge than the CT-ZMP gets the DCM would only go on.
        arrived=min(plain.arrived, half - _INNER_MARGIN - _ARRIVING * inwards),
        inwards=inwards,
        inner=max(inwards + _STRAY - (half - margin), 0.0),
        outer=margin + _OUTER,
        momentum=margin + _ASKED,
        narrow=True,
    )


def side(foot: int) -> float:
    """To which side a foot is of the other: 1 for the left one, -1 for the right one."""
    return 1.0 if foot == 0 else -1.0


def bearing(robot: Robot, sole: str, outwards: float) -> SolePart:
    """The sole, without the part that its leg cannot hold."""
    model, data = robot.model, robot.model.createData()
    frame, size = robot.frame_id(sole), robot.soles[sole]
    pin.computeJointJacobians(model, data, robot.q_home)
    J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
    pose = pin.updateFramePlacement(model, data, frame)
    ends: list[Point] = []
    for axis, half in enumerate((0.5 * size.length, 0.5 * size.width)):
        low, high = -half, half
        for joint in reversed(robot.leg_joints(sole)):
            column = model.joints[joint].idx_v
            # The joint that turns it about the other axis, nearer to that than to this one.
            if abs(J[4 - axis, column]) > math.sqrt(0.5):
                at = float(pose.actInv(data.oMi[joint].translation)[axis])
                reach = float(robot.tau_max[column - robot.base_dofs]) / robot.weight
                # An ankle that holds nothing of the sole: as near to its axis as can be.
                low, high = min(max(at - reach, -half), half), max(min(at + reach, half), -half)
                break
        ends.append((low, high))
    (back, front), (right, left) = ends
    if size.leans:
        left = right = 0.5 * outwards * size.width
    return SolePart(0.5 * (front + back), 0.5 * (left + right), front - back, left - right)
