"""Support regions, compiled: outlines of the CoP that the legs' torques can hold.

Convex polygons in the plane: the outline of points, edges, and the nearest point inside.

A vertical force f at p is held by a joint of the leg, with the axis a through o, by the torque

    f [a x (p - o)]_z

so a joint with the largest torque tau carries the weight m g at places no farther than tau / (m g)
from its axis, and a part tau / (m g |[a x (p - o)]_z|) of it at others: R. Orsolino, M. Focchi,
S. Caron, G. Raiola, V. Barasuol, D. G. Caldwell, C. Semini, "Feasible region: an actuation-aware
extension of the support region" (2020). The weight of the leg itself is left out, and tangential
forces, which sum up to nothing at rest.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, part
from poise.dynamics import KINEMATICS, ROTATION, StateNumbers, column_at, place_frame
from poise.stack._tables import Line, StackNumbers, line_of

_STEEP = 0.7
"""Cosine of a contact's slope beyond which it is no ground: a hand on a wall can hold a robot whose
divergent component is anywhere."""

POINTS, OUTLINE = 12, 16
CORNERS = POINTS + 2 * OUTLINE
"""Points a contact of the room for polygons: corners of a rectangle and two others for each; and
the outline of these others, which may take twice as many while it is looked for, twice."""

BASE = 6
"""Coordinates of the base, which has no torques."""

_SMALLEST = 0.3
"""Part of half a sole that is left where the leg cannot stand on this foot alone."""

_GRID = 2.0**-28
"""Points are taken to the nearest of a grid [m], on which no rounding decides what is a corner.

Corners of soles side by side are in line but for the last digit, and a chain that took three of
them for a line where they go there and back lost a foot's corner. Up to 4 m across, areas have 63
bits."""


class BalanceSettings(NamedTuple):
    """First parameters of the balance limit."""

    decay: float  # how fast the way out to an edge is used up [1/s]
    margin: float  # distance kept from the edges, at most half of what there is [m]
    least_load: float  # normal force that a contact must be able to carry to count [N]
    braking: float  # of the legs' bounds [m/s^2]
    horizon: float  # of the legs' bounds [s]
    stop_time: float  # in which the soles could stop the angular momentum [s]


NEXT_STEP = len(BalanceSettings._fields)
TORQUES = NEXT_STEP + 8
"""Places in the limit's parameters: x and y of the four corners of the next foothold, NaN for none
[m], the largest torques of all joints [N m]. The least and the largest length of each leg [m]
follow."""


@part
def balance_settings(parameters: Float64[np.ndarray, " p"], start: int) -> BalanceSettings:
    """The settings among all parameters."""
    p = parameters[start : start + NEXT_STEP]
    return BalanceSettings(p[0], p[1], p[2], p[3], p[4], p[5])


@part
def outline_support(
    state: StateNumbers, assembly: StackNumbers, line: Line, caught: int
) -> tuple[Float64[np.ndarray, "k 2"], float]:
    """Outline where the soles can press, or with 1 where the DCM is caught.

    That is the same with margins, and with the next foothold. Returns the corners,
    counter-clockwise, none where a contact is no ground, and the mean height of the contacts [m].
    """
    motion, owners, work = state.motion, assembly.owners, assembly.work
    parameters, weight = owners.parameters, -motion.mass[0] * motion.gravity[2]
    size = owners.contacts + 1
    points = owners.corners[: POINTS * size]
    hull = owners.corners[(POINTS + caught * OUTLINE) * size :]
    settings = balance_settings(parameters, line.start)
    margin = settings.margin if caught else 0.0
    feet, height = 0, 0.0
    for i in range(owners.contacts):
        contact = line_of(owners, i)
        place_frame(motion, owners.frames, contact.frame, work, 0)
        if work[ROTATION + 8] < _STEEP:
            return hull[:0], 0.0
        lower, reach = contact.start + 1, contact.start + 1 + 2 * contact.dim
        if parameters[lower + contact.dim + 2] < settings.least_load:
            continue
        length, width = parameters[reach], parameters[reach + 1]
        length -= min(margin, 0.5 * length)
        width -= min(margin, 0.5 * width)
        for corner in range(4):
            along = length if corner < 2 else -length
            aside = width if corner % 3 == 0 else -width
            for k in range(2):
                R = ROTATION + 3 * k
                points[4 * feet + corner, k] = work[k] + along * work[R] + aside * work[R + 1]
        # Beside the frame: whose it is, and the part of the weight that it has to carry.
        work[KINEMATICS + 2 * feet] = float(contact.frame)
        work[KINEMATICS + 2 * feet + 1] = parameters[lower + 2] / weight
        height += work[2]
        feet += 1
    last = 4 * feet
    for foot in range(feet):
        frame = int(work[KINEMATICS + 2 * foot])
        least = work[KINEMATICS + 2 * ((foot + 1) % feet) + 1] if feet > 1 else 0.0
        for corner in range(4):
            which = (foot, corner, feet)
            last = _press(state, assembly, line.start + TORQUES, frame, points, which, least, last)
    if caught and feet > 0 and not np.isnan(parameters[line.start + NEXT_STEP]):
        for k in range(4):
            points[last, 0] = parameters[line.start + NEXT_STEP + 2 * k]
            points[last, 1] = parameters[line.start + NEXT_STEP + 2 * k + 1]
            last += 1
    corners = find_hull(points[4 * feet :], last - 4 * feet, hull)
    return hull[:corners], height / max(feet, 1)


@part
def _press(
    state: StateNumbers,
    assembly: StackNumbers,
    torques: int,
    frame: int,
    points: Float64[np.ndarray, "k 2"],
    which: tuple[int, int, int],
    least: float,
    last: int,
) -> int:
    """A corner, or as near to it as the leg can carry the weight, alone and shared.

    The next foot carries its least load, or the rest, at the same corner.
    """
    motion, owners = state.motion, assembly.owners
    foot, corner, feet = which
    frames, at = owners.frames, 4 * foot
    x, y = points[at + corner, 0], points[at + corner, 1]
    mx = 0.5 * (points[at, 0] + points[at + 2, 0])
    my = 0.5 * (points[at, 1] + points[at + 2, 1])
    weight = -motion.mass[0] * motion.gravity[2]
    share, way, alone = 1.0 - least, 1.0, True
    other = 4 * ((foot + 1) % feet) + corner
    for k in range(frames.starts[frame], frames.starts[frame + 1]):
        column = int(frames.columns[k])
        if column < BASE:
            continue
        arm = owners.parameters[torques + column - BASE] / weight
        lever = column_at(motion, column, x, y, 0.0)[2]
        if abs(lever) <= arm:
            continue
        share = min(share, arm / abs(lever))
        middle = column_at(motion, column, mx, my, 0.0)[2] * (1.0 if lever > 0.0 else -1.0)
        way = min(way, (arm - middle) / (abs(lever) - middle))
        alone = alone and abs(middle) < arm
    if alone or feet == 1:
        way = max(way, _SMALLEST)
        points[last, 0] = (1.0 - least) * (mx + way * (x - mx)) + least * points[other, 0]
        points[last, 1] = (1.0 - least) * (my + way * (y - my)) + least * points[other, 1]
        last += 1
    if share < 1.0 - least and feet > 1:
        for i in range(2):
            points[last, i] = share * points[at + corner, i] + (1.0 - share) * points[other, i]
        last += 1
    return last


@part
def edge_of(hull: Float64[np.ndarray, "k 2"], i: int) -> tuple[float, float, float]:
    """Outward normal n of an edge of unit length, and h, for n x <= h."""
    (ax, ay), (bx, by) = (
        (hull[i, 0], hull[i, 1]),
        (hull[(i + 1) % len(hull), 0], hull[(i + 1) % len(hull), 1]),
    )
    length = sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
    nx, ny = (by - ay) / length, (ax - bx) / length
    return nx, ny, nx * ax + ny * ay


@part
def nearest_inside(hull: Float64[np.ndarray, "k 2"], x: float, y: float) -> tuple[float, float]:
    """The point itself where a polygon holds it, else the nearest of the outline."""
    inside, least, near_x, near_y = True, np.inf, x, y
    for i in range(len(hull)):
        nx, ny, h = edge_of(hull, i)
        other = (i + 1) % len(hull)
        # Along the edge, to the left of its normal.
        begin = nx * hull[i, 1] - ny * hull[i, 0]
        end = nx * hull[other, 1] - ny * hull[other, 0]
        inside = inside and nx * x + ny * y <= h
        along = min(end, max(begin, nx * y - ny * x))
        px, py = h * nx - along * ny, h * ny + along * nx
        square = (px - x) * (px - x) + (py - y) * (py - y)
        if square < least:
            least, near_x, near_y = square, px, py
    return (x, y) if inside else (near_x, near_y)


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
