"""Support regions, compiled: outlines of the CoP that the legs' torques can hold.

A vertical force f at p is held by a joint of the leg, with the axis a through o, by the torque

    f [a x (p - o)]_z

so a joint with the largest torque tau carries the weight m g at places no farther than tau / (m g)
from its axis, and a part tau / (m g |[a x (p - o)]_z|) of it at others: R. Orsolino, M. Focchi,
S. Caron, G. Raiola, V. Barasuol, D. G. Caldwell, C. Semini, "Feasible region: an actuation-aware
extension of the support region" (2020). The weight of the leg itself is left out, and tangential
forces, which sum up to nothing at rest.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.dynamics import ROTATION, StateNumbers, column_at, place_frame
from poise.stack._polygon import find_hull
from poise.stack._tables import (
    CONTACT,
    CORNERS,
    COUNT,
    FRAME_INDEX,
    KIND,
    OUTLINE,
    POINTS,
    START,
    Line,
    StackNumbers,
)

MARGIN, LEAST_LOAD, NEXT_STEP, TORQUES = 1, 2, 6, 14
"""Places in the limit's parameters: distance kept from the edges [m], normal force that a contact
must be able to carry to count [N], x and y of the four corners of the next foothold, NaN for none
[m], the largest torques of all joints [N m]."""

_STEEP = 0.7
"""Cosine of a contact's slope beyond which it is no ground: a hand on a wall can hold a robot whose
divergent component is anywhere."""

_MARGIN_RATIO = 0.5
"""A margin takes away no more than this part of half a sole's length or width."""

BASE = 6
"""Coordinates of the base, which has no torques."""

_SMALLEST = 0.3
"""Part of half a sole that is left where the leg cannot stand on this foot alone."""


class Support(NamedTuple):
    """Support regions of the feet.

    Attributes:
        outer: corners of where the soles can press, counter-clockwise; none where a contact is no
            ground [m].
        inner: the same with margins, and with the next foothold: where the component is caught [m].
        height: mean of the contacts [m].
    """

    outer: Float64[np.ndarray, "k 2"]
    inner: Float64[np.ndarray, "n 2"]
    height: float


@part
def outline_support(state: StateNumbers, assembly: StackNumbers, line: Line) -> Support:
    """Outlines of where the ZMP can be now, and of where the DCM is caught."""
    owners = assembly.owners
    size = len(owners.corners) // CORNERS
    # Points of whole and of smaller rectangles, then the outlines of both.
    reach = owners.corners[: POINTS * size]
    catch = owners.corners[POINTS * size : 2 * POINTS * size]
    outer = owners.corners[2 * POINTS * size : (2 * POINTS + OUTLINE) * size]
    inner = owners.corners[(2 * POINTS + OUTLINE) * size :]
    feet, height = _gather(state, assembly, line, reach, catch)
    if feet == 0:
        return Support(outer[:0], inner[:0], 0.0)
    count = 4 * feet
    last = _press(state, assembly, line, reach, feet)
    standing = find_hull(reach[count:], last - count, outer)
    last = _press(state, assembly, line, catch, feet)
    last = _add_next_step(owners.parameters, line[START], catch, last)
    caught = find_hull(catch[count:], last - count, inner)
    return Support(outer[:standing], inner[:caught], height)


@part
def _gather(
    state: StateNumbers,
    assembly: StackNumbers,
    line: Line,
    reach: Float64[np.ndarray, "k 2"],
    catch: Float64[np.ndarray, "k 2"],
) -> tuple[int, float]:
    """Corners of the contacts that carry, of their whole rectangles and of smaller ones."""
    motion, owners, work = state.motion, assembly.owners, assembly.work
    parameters, at = owners.parameters, line[START]
    count, height = 0, 0.0
    for other in owners.lines:
        if other[KIND] != CONTACT:
            break
        begin = other[START]
        place_frame(motion, owners.frames, other[FRAME_INDEX], work, 0)
        if work[ROTATION + 8] < _STEEP:
            return 0, 0.0
        if not _carries(assembly, line, other):
            continue
        height += work[2]
        m = other[COUNT]
        length, width = parameters[begin + 1 + 2 * m], parameters[begin + 2 + 2 * m]
        inner_length = length - min(parameters[at + MARGIN], _MARGIN_RATIO * length)
        inner_width = width - min(parameters[at + MARGIN], _MARGIN_RATIO * width)
        for corner in range(4):
            along = 1.0 if corner < 2 else -1.0
            aside = 1.0 if corner % 3 == 0 else -1.0
            for i in range(2):
                x, y = along * work[ROTATION + 3 * i], aside * work[ROTATION + 3 * i + 1]
                reach[4 * count + corner, i] = work[i] + length * x + width * y
                catch[4 * count + corner, i] = work[i] + inner_length * x + inner_width * y
        count += 1
    return count, height / max(count, 1)


@part
def _carries(assembly: StackNumbers, line: Line, other: Line) -> bool:
    owners = assembly.owners
    most = owners.parameters[other[START] + 3 + other[COUNT]]
    return bool(most >= owners.parameters[line[START] + LEAST_LOAD])


@part
def _press(
    state: StateNumbers,
    assembly: StackNumbers,
    line: Line,
    points: Float64[np.ndarray, "k 2"],
    feet: int,
) -> int:
    """Outline the CoP of each foot, alone and with the next one's help, after the corners."""
    motion, owners = state.motion, assembly.owners
    foot, last = 0, 4 * feet
    weight = -motion.mass[0] * motion.gravity[2]
    for other in owners.lines:
        if other[KIND] != CONTACT:
            break
        if not _carries(assembly, line, other):
            continue
        least = 0.0 if feet == 1 else _least_share(assembly, line, (foot + 1) % feet, weight)
        for corner in range(4):
            last = _press_corner(
                state,
                assembly,
                (line[START] + TORQUES, other[FRAME_INDEX]),
                points,
                (foot, corner, feet),
                least,
                last,
            )
        foot += 1
    return last


@part
def _least_share(assembly: StackNumbers, line: Line, foot: int, weight: float) -> float:
    """Part of the weight that a foot has to carry: what contacts are not let go of by."""
    owners = assembly.owners
    place = 0
    for other in owners.lines:
        if other[KIND] != CONTACT:
            break
        if not _carries(assembly, line, other):
            continue
        if place == foot:
            return float(owners.parameters[other[START] + 3] / weight)
        place += 1
    return 0.0


@part
def _press_corner(
    state: StateNumbers,
    assembly: StackNumbers,
    leg: tuple[int, int],
    points: Float64[np.ndarray, "k 2"],
    which: tuple[int, int, int],
    least: float,
    last: int,
) -> int:
    """A corner, or as near to it as the leg can carry the weight, alone and shared.

    The next foot carries its least load, or the rest, at the same corner.
    """
    motion, owners = state.motion, assembly.owners
    (torques, frame), (foot, corner, feet) = leg, which
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
def _add_next_step(
    parameters: Float64[np.ndarray, " p"], at: int, catch: Float64[np.ndarray, "k 2"], count: int
) -> int:
    """Add the corners of the next foothold; returns how many there are then."""
    if np.isnan(parameters[at + NEXT_STEP]):
        return count
    for corner in range(4):
        catch[count + corner, 0] = parameters[at + NEXT_STEP + 2 * corner]
        catch[count + corner, 1] = parameters[at + NEXT_STEP + 2 * corner + 1]
    return count + 4
