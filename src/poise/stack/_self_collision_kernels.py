"""The rows of `SelfCollisionLimit`, compiled: see there for what they keep."""

from math import sqrt

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import part
from poise.dynamics import (
    BIAS,
    KINEMATICS,
    ROTATION,
    VELOCITY,
    StateNumbers,
    column_at,
    place_frame,
    turn_to_world,
)
from poise.stack._tables import CHOSEN, FIRST, FRAME_INDEX, START, Line, StackNumbers
from poise.stack._viability import largest_acceleration

BRAKING, HORIZON, APPROACH, SHAPES, SHAPE = 0, 1, 2, 3, 7
"""Places in the limit's parameters: braking [m/s^2], horizon [s] and time of approach [s]; where
the capsules begin, both ends of the axis and the radius of each [m], and how many numbers each has.
The least distance of each pair follows [m]."""

PAIRS = 10
"""Rows: pairs of capsules that are looked after at a time."""

_NEAR = 0.5
"""Pairs farther apart than this have no row [m]."""

_AHEAD = 0.16
"""How far ahead it is looked which pairs will be nearest [s]."""

_HARDEST = 30.0
"""Largest acceleration of a distance that is asked for [m/s^2]."""

_ANY_SPEED = 1e9
"""Distances have no velocity limit of their own [m/s]."""

_TOUCHING = 1e-6
"""Axes that are nearer than this have no direction from one to the other [m]."""

_MIDDLE, _HALF, _SPEED, _PLACED, _CHOSEN_PAIR = 6, 9, 10, 11, 6
"""Numbers a capsule of the room: both ends of its axis in the world, its middle, half its length,
the largest speed of its points; numbers a row: pair, place on either axis, distance of the axes,
its rate, and what the pair is ranked by."""


def room_for(frames: int, capsules: int) -> int:
    """Numbers of work space."""
    return KINEMATICS * frames + _PLACED * capsules + _CHOSEN_PAIR * PAIRS


@part
def bound_self_collision(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """Rows for the distances of the pairs that are about to be nearest."""
    motion, owners, rows, work = state.motion, assembly.owners, assembly.rows, assembly.work
    first, nv = int(line[FIRST]), len(motion.columns)
    for row in range(first, first + PAIRS):
        for k in range(nv):
            rows.matrix[rows.first + row, k] = 0.0
        rows.target[row], rows.upper[row], rows.weight[row] = -np.inf, np.inf, 1.0
        rows.error[row] = np.inf
    table = owners.chosen[line[CHOSEN] :]
    capsules = int(table[0])
    frames = int(line[FRAME_INDEX])
    last = 0
    for i in range(capsules):
        last = max(last, int(table[2 + i]))
    for i in range(last + 1):
        place_frame(motion, owners.frames, frames + i, work, i * KINEMATICS)
        turn_to_world(work, i * KINEMATICS)
    placed = (last + 1) * KINEMATICS
    _place_capsules(owners.parameters, int(line[START]), table, work, placed)
    chosen = placed + _PLACED * capsules
    count = _choose(owners.parameters, int(line[START]), table, work, placed, chosen)
    taken = 0
    for i in range(count):
        # A pair has its own row, as long as no other has it: what is active stays so.
        slot = int(work[chosen + i * _CHOSEN_PAIR]) % PAIRS
        while (taken >> slot) & 1:
            slot = (slot + 1) % PAIRS
        taken |= 1 << slot
        at = chosen + i * _CHOSEN_PAIR
        _write(state, assembly, line, first + slot, placed, at)


@part
def _place_capsules(
    parameters: Float64[np.ndarray, " p"],
    start: int,
    table: Int64[np.ndarray, " t"],
    work: Float64[np.ndarray, " work"],
    placed: int,
) -> None:
    """Axes of all capsules in the world, with bounds of what their points do."""
    for i in range(table[0]):
        frame, shape = int(table[2 + i]) * KINEMATICS, start + SHAPES + SHAPE * i
        for side in range(2):
            x, y, z = (
                parameters[shape + 3 * side],
                parameters[shape + 3 * side + 1],
                parameters[shape + 3 * side + 2],
            )
            for k in range(3):
                R = frame + ROTATION + 3 * k
                work[placed + _PLACED * i + 3 * side + k] = (
                    work[frame + k] + work[R] * x + work[R + 1] * y + work[R + 2] * z
                )
        a, square = placed + _PLACED * i, 0.0
        for k in range(3):
            work[a + _MIDDLE + k] = 0.5 * (work[a + k] + work[a + 3 + k])
            square += (work[a + k] - work[a + 3 + k]) ** 2
        work[a + _HALF] = 0.5 * sqrt(square)
        # Speed is convex along the axis.
        one = _velocity(work, frame, _point(work, a, 0.0))
        other = _velocity(work, frame, _point(work, a, 1.0))
        fastest = max(
            one[0] * one[0] + one[1] * one[1] + one[2] * one[2],
            other[0] * other[0] + other[1] * other[1] + other[2] * other[2],
        )
        work[a + _SPEED] = sqrt(fastest)


@part
def _choose(
    parameters: Float64[np.ndarray, " p"],
    start: int,
    table: Int64[np.ndarray, " t"],
    work: Float64[np.ndarray, " work"],
    placed: int,
    chosen: int,
) -> int:
    """Find the pairs that will be nearest; returns how many there are.

    A pair is left out as soon as its middles are farther apart than one that would count.
    """
    capsules, pairs = int(table[0]), int(table[1])
    count, margins = 0, start + SHAPES + SHAPE * capsules
    last, most = 0, np.inf
    for pair in range(pairs):
        i, j = int(table[2 + capsules + 2 * pair]), int(table[3 + capsules + 2 * pair])
        a, b = placed + _PLACED * i, placed + _PLACED * j
        radii = (
            parameters[start + SHAPES + SHAPE * i + 6] + parameters[start + SHAPES + SHAPE * j + 6]
        )
        least = parameters[margins + pair]
        speed = work[a + _SPEED] + work[b + _SPEED]
        within = radii + work[a + _HALF] + work[b + _HALF]
        within += min(_NEAR, most + least + _AHEAD * speed)
        square = 0.0
        for k in range(3):
            square += (work[a + _MIDDLE + k] - work[b + _MIDDLE + k]) ** 2
        if within <= 0.0 or square > within * within:
            continue
        s, t, distance = _nearest_points(work, a, b)
        if distance - radii > _NEAR or distance < _TOUCHING:
            continue
        rate = _rate(work, table, (i, j), (a, b), (s, t), distance)
        # By what is left to the least distance of each.
        left = distance - radii - least + _AHEAD * min(rate, 0.0)
        place = count
        if count == PAIRS:
            place = last
            if left >= most:
                continue
        else:
            count += 1
        at = chosen + place * _CHOSEN_PAIR
        work[at], work[at + 1], work[at + 2] = float(pair), s, t
        work[at + 3], work[at + 4], work[at + 5] = distance, rate, left
        if count == PAIRS:
            last, most = 0, work[chosen + 5]
            for k in range(1, PAIRS):
                if work[chosen + k * _CHOSEN_PAIR + 5] > most:
                    last, most = k, work[chosen + k * _CHOSEN_PAIR + 5]
    return count


@part
def _nearest_points(
    work: Float64[np.ndarray, " work"], a: int, b: int
) -> tuple[float, float, float]:
    """Nearest points of two axes, from 0 to 1, and their distance (Ericson 2005, 5.1.9)."""
    aa = bb = ab = aw = bw = 0.0
    for k in range(3):
        u, v = work[a + 3 + k] - work[a + k], work[b + 3 + k] - work[b + k]
        w = work[a + k] - work[b + k]
        aa += u * u
        bb += v * v
        ab += u * v
        aw += u * w
        bw += v * w
    s, det = 0.0, aa * bb - ab * ab
    if det > 1e-9 * aa * bb:
        s = min(max((ab * bw - bb * aw) / det, 0.0), 1.0)
    t = (ab * s + bw) / bb if bb > 1e-12 else 0.0
    if bb <= 1e-12 or t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((ab * t - aw) / aa, 0.0), 1.0) if aa > 1e-12 else 0.0
    square = 0.0
    for k in range(3):
        p = work[a + k] + s * (work[a + 3 + k] - work[a + k])
        q = work[b + k] + t * (work[b + 3 + k] - work[b + k])
        square += (p - q) ** 2
    return s, t, sqrt(square)


@part
def _rate(
    work: Float64[np.ndarray, " work"],
    table: Int64[np.ndarray, " t"],
    pair: tuple[int, int],
    axes: tuple[int, int],
    places: tuple[float, float],
    distance: float,
) -> float:
    """The rate of a distance of axes [m/s]."""
    p, q = _point(work, axes[0], places[0]), _point(work, axes[1], places[1])
    vp = _velocity(work, int(table[2 + pair[0]]) * KINEMATICS, p)
    vq = _velocity(work, int(table[2 + pair[1]]) * KINEMATICS, q)
    return (
        (p[0] - q[0]) * (vp[0] - vq[0])
        + (p[1] - q[1]) * (vp[1] - vq[1])
        + (p[2] - q[2]) * (vp[2] - vq[2])
    ) / distance


@part
def _point(
    work: Float64[np.ndarray, " work"], axis: int, place: float
) -> tuple[float, float, float]:
    return (
        work[axis] + place * (work[axis + 3] - work[axis]),
        work[axis + 1] + place * (work[axis + 4] - work[axis + 1]),
        work[axis + 2] + place * (work[axis + 5] - work[axis + 2]),
    )


@part
def _velocity(
    work: Float64[np.ndarray, " work"], frame: int, p: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Velocity of a point that is fixed to a frame."""
    x, y, z = p[0] - work[frame], p[1] - work[frame + 1], p[2] - work[frame + 2]
    v = frame + VELOCITY
    return (
        work[v] + work[v + 4] * z - work[v + 5] * y,
        work[v + 1] + work[v + 5] * x - work[v + 3] * z,
        work[v + 2] + work[v + 3] * y - work[v + 4] * x,
    )


@part
def _acceleration(
    work: Float64[np.ndarray, " work"], frame: int, p: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Acceleration at zero `dv` of a point that is fixed to a frame."""
    x, y, z = p[0] - work[frame], p[1] - work[frame + 1], p[2] - work[frame + 2]
    w, b = frame + VELOCITY + 3, frame + BIAS
    wx, wy, wz = work[w], work[w + 1], work[w + 2]
    vx, vy, vz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    return (
        work[b] + work[b + 4] * z - work[b + 5] * y + wy * vz - wz * vy,
        work[b + 1] + work[b + 5] * x - work[b + 3] * z + wz * vx - wx * vz,
        work[b + 2] + work[b + 3] * y - work[b + 4] * x + wx * vy - wy * vx,
    )


@part
def _write(
    state: StateNumbers, assembly: StackNumbers, line: Line, row: int, placed: int, at: int
) -> None:
    """The row of a pair that was chosen."""
    motion, owners, rows, work, velocities = (
        state.motion,
        assembly.owners,
        assembly.rows,
        assembly.work,
        assembly.velocities,
    )
    parameters, start, table = owners.parameters, int(line[START]), owners.chosen[line[CHOSEN] :]
    capsules, pair = int(table[0]), int(work[at])
    i, j = int(table[2 + capsules + 2 * pair]), int(table[3 + capsules + 2 * pair])
    a, b = placed + _PLACED * i, placed + _PLACED * j
    one, other = int(table[2 + i]), int(table[2 + j])
    s, t, length, rate = work[at + 1], work[at + 2], work[at + 3], work[at + 4]
    p, q = _point(work, a, s), _point(work, b, t)
    n = ((p[0] - q[0]) / length, (p[1] - q[1]) / length, (p[2] - q[2]) / length)
    shapes = start + SHAPES
    distance = length - parameters[shapes + SHAPE * i + 6] - parameters[shapes + SHAPE * j + 6]
    room = distance - parameters[shapes + SHAPE * capsules + pair]
    rows.error[row], rows.error_rate[row] = distance, float(pair)
    if velocities:
        rows.target[row] = rows.reference[row] = -room / parameters[start + APPROACH]
        rows.drift[row] = 0.0
    else:
        horizon = parameters[start + HORIZON]
        drift = _drift(work, (a, b), (s, t), (one, other), n, length, rate, horizon)
        settings = (_HARDEST, float(horizon), float(parameters[start + BRAKING]))
        reference = -largest_acceleration(room, -rate, _ANY_SPEED, settings)
        rows.target[row], rows.drift[row] = reference - drift, drift
        rows.reference[row] = reference
    frames = owners.frames
    one, other = one + int(line[FRAME_INDEX]), other + int(line[FRAME_INDEX])
    # What carries both moves neither against the other.
    k, m = int(frames.starts[one]), int(frames.starts[other])
    end, last = int(frames.starts[one + 1]), int(frames.starts[other + 1])
    while k < end and m < last and frames.columns[k] == frames.columns[m]:
        k += 1
        m += 1
    while k < end:
        column = int(frames.columns[k])
        c = column_at(motion, column, p[0], p[1], p[2])
        rows.matrix[rows.first + row, column] = n[0] * c[0] + n[1] * c[1] + n[2] * c[2]
        k += 1
    while m < last:
        column = int(frames.columns[m])
        c = column_at(motion, column, q[0], q[1], q[2])
        rows.matrix[rows.first + row, column] = -(n[0] * c[0] + n[1] * c[1] + n[2] * c[2])
        m += 1


@part
def _drift(
    work: Float64[np.ndarray, " work"],
    axes: tuple[int, int],
    places: tuple[float, float],
    frames: tuple[int, int],
    n: tuple[float, float, float],
    length: float,
    rate: float,
    horizon: float,
) -> float:
    """Second derivative of a distance at zero `dv`.

    With g = |x_a(s) - x_b(t)|^2 / 2 over the places s and t on the axes, whose nearest points they
    are, the rate of g is its partial one, and the rate of that

        g_ddot = g_tt - g_tp^T g_pp^-1 g_tp,        p the places that are inside their axes.
    """
    (a, b), (s, t) = axes, places
    one, other = frames[0] * KINEMATICS, frames[1] * KINEMATICS
    p, q = _point(work, a, s), _point(work, b, t)
    vp, vq = _velocity(work, one, p), _velocity(work, other, q)
    ap, aq = _acceleration(work, one, p), _acceleration(work, other, q)
    slip = (vp[0] - vq[0], vp[1] - vq[1], vp[2] - vq[2])
    square = slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2]
    drift = n[0] * (ap[0] - aq[0]) + n[1] * (ap[1] - aq[1]) + n[2] * (ap[2] - aq[2])
    drift += (square - rate * rate) / length
    aa, as_ = _along(work, a, one, slip, n, length)
    bb, bs = _along(work, b, other, slip, n, length)
    bs = -bs
    free_a, free_b = 0.0 < s < 1.0 and aa > 1e-12, 0.0 < t < 1.0 and bb > 1e-12
    slide = 0.0
    if free_a and free_b:
        ab = 0.0
        for k in range(3):
            ab += (work[a + 3 + k] - work[a + k]) * (work[b + 3 + k] - work[b + k])
        # The inverse of [[aa, -ab], [-ab, bb]]; parallel axes have no nearest points to follow.
        det = max(aa * bb - ab * ab, 1e-6 * aa * bb)
        slide = (bb * as_ * as_ + 2.0 * ab * as_ * bs + aa * bs * bs) / det
    elif free_a:
        slide = as_ * as_ / aa
    elif free_b:
        slide = bs * bs / bb
    # Nobody comes nearer within the horizon than at the speed of the points themselves.
    return drift - min(slide / length, sqrt(square) / horizon)


@part
def _along(
    work: Float64[np.ndarray, " work"],
    axis: int,
    frame: int,
    slip: tuple[float, float, float],
    n: tuple[float, float, float],
    length: float,
) -> tuple[float, float]:
    """Square of an axis' length; and the rate of (x_a - x_b) u, for its vector u."""
    x, y, z = (
        work[axis + 3] - work[axis],
        work[axis + 4] - work[axis + 1],
        work[axis + 5] - work[axis + 2],
    )
    w = frame + VELOCITY + 3
    tx = work[w + 1] * z - work[w + 2] * y
    ty = work[w + 2] * x - work[w] * z
    tz = work[w] * y - work[w + 1] * x
    turning = length * (n[0] * tx + n[1] * ty + n[2] * tz)
    return x * x + y * y + z * z, slip[0] * x + slip[1] * y + slip[2] * z + turning
