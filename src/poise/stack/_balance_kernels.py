"""The rows of `BalanceLimit`, compiled: see there for what they keep, and why they can be kept."""

from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.dynamics import (
    BIAS,
    KINEMATICS,
    VELOCITY,
    StateNumbers,
    column_at,
    momentum_rate,
    place_frame,
    turn_to_world,
)
from poise.stack._polygon import nearest_inside
from poise.stack._support_kernels import BASE, NEXT_STEP, TORQUES, Support, outline_support
from poise.stack._tables import (
    CHOSEN,
    COUNT,
    FIRST,
    FRAME_INDEX,
    START,
    Line,
    StackNumbers,
)
from poise.stack._viability import largest_acceleration

DECAY, BRAKING, HORIZON, STOP = 0, 3, 4, 5
"""Places in the limit's parameters: how fast the way out to an edge is used up [1/s], braking
[m/s^2] and horizon [s] of the legs' bounds, time in which the soles could stop the angular momentum
[s]; the others are for where the soles can press. The least and the largest length of each leg [m]
are their last."""

MOST_EDGES = 12
"""Rows for edges of the support: two soles and a foothold have no more."""

FIRST_LEG = MOST_EDGES + 3
"""Rows of the edges, and of the angular momentum about the three axes."""

_STEP_DECAY = 60.0
"""Least decay while a step is announced [1/s]: a step takes the component to the next foothold at
its full speed, and the ZMP goes over to it within a tenth of a second."""

_COMEBACK = 12.0
"""Least rate at which the component comes back from beyond an edge [1/s]: a vertical that is off by
an angle pushes it out there by h angle omega / rate."""

_LOWEST = 0.1
"""Least height of the COM over the contacts that is reckoned with [m]."""

_LEAST_ARM, _CATCHING, _MOST_ARM = 0.3, 10.0, 1.4
"""Part of the moment that remains where the component is on the edge; how much more there is, as an
arm, by how far it is outside, for hips need it to catch; and how much there is at most."""

_ANY_SPEED = 1e9
"""Legs have no velocity limit of their own [m/s]."""


@part
def bound_balance(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """Rows for the edges of the support, the angular momentum, then one a leg."""
    v, rows = state.v, assembly.rows
    for i in range(line[COUNT]):
        row = line[FIRST] + i
        for k in range(len(v)):
            rows.matrix[rows.first + row, k] = 0.0
        rows.target[row], rows.upper[row], rows.weight[row] = -np.inf, np.inf, 1.0
        rows.error[row] = np.inf
    _bound_edges(state, assembly, line)
    for leg in range(line[COUNT] - FIRST_LEG):
        _bound_leg(state, assembly, line, leg)


@part
def _bound_edges(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    v, motion, owners, rows, work = (
        state.v,
        state.motion,
        assembly.owners,
        assembly.rows,
        assembly.work,
    )
    support = outline_support(state, assembly, line)
    outer, inner, caught = support.outer, support.inner, len(support.inner)
    if min(len(outer), caught) < 3:
        return
    decay = owners.parameters[line[START] + DECAY]
    if not np.isnan(owners.parameters[line[START] + NEXT_STEP]):
        decay = max(decay, _STEP_DECAY)
    omega = sqrt(-motion.gravity[2] / max(motion.com[2] - support.height, _LOWEST))
    speed_x = speed_y = 0.0
    for k in range(len(v)):
        speed_x += motion.momentum[k, 0] * v[k] / motion.mass[0]
        speed_y += motion.momentum[k, 1] * v[k] / motion.mass[0]
    xi_x, xi_y = motion.com[0] + speed_x / omega, motion.com[1] + speed_y / omega
    near_x, near_y = nearest_inside(inner, xi_x, xi_y)
    comeback = max(decay, _COMEBACK)
    back = comeback / omega
    zmp_x, zmp_y = nearest_inside(
        outer, xi_x + back * (xi_x - near_x), xi_y + back * (xi_y - near_y)
    )
    momentum_rate(motion, work, 0)
    for i in range(caught):
        ax, ay = inner[i, 0], inner[i, 1]
        ex, ey = inner[(i + 1) % caught, 0] - ax, inner[(i + 1) % caught, 1] - ay
        length = sqrt(ex * ex + ey * ey)
        nx, ny = ey / length, -ex / length
        left = nx * (ax - xi_x) + ny * (ay - xi_y)
        place = _rank_among_nearest(inner, i, left, xi_x, xi_y)
        if place >= MOST_EDGES:
            continue
        # The component may approach the edge, or do what the ZMP cannot keep it from.
        rate = decay * left if left > 0.0 else comeback * left
        rate = max(rate, omega * (nx * (xi_x - zmp_x) + ny * (xi_y - zmp_y)))
        row = line[FIRST] + place
        reference = omega * (rate - nx * speed_x - ny * speed_y)
        drift = (nx * work[0] + ny * work[1]) / motion.mass[0]
        rows.upper[row] = reference - drift
        rows.reference[row], rows.drift[row], rows.error[row] = reference, drift, left
        for k in range(len(v)):
            rows.matrix[rows.first + row, k] = (
                nx * motion.momentum[k, 0] + ny * motion.momentum[k, 1]
            ) / motion.mass[0]
    _bound_momentum(state, assembly, line, support, (xi_x, xi_y))


@part
def _bound_momentum(
    state: StateNumbers,
    assembly: StackNumbers,
    line: Line,
    support: Support,
    xi: tuple[float, float],
) -> None:
    """The angular momentum about the COM, as the acceleration that as much force gave it."""
    v, motion, owners, rows, work = (
        state.v,
        state.motion,
        assembly.owners,
        assembly.rows,
        assembly.work,
    )
    hull, count = support.inner, len(support.inner)
    mx = my = 0.0
    for i in range(count):
        mx += hull[i, 0] / count
        my += hull[i, 1] / count
    arm = np.inf
    # The least distance of an edge from the middle of the corners.
    for i in range(count):
        ax, ay = hull[i, 0], hull[i, 1]
        ex, ey = hull[(i + 1) % count, 0] - ax, hull[(i + 1) % count, 1] - ay
        arm = min(arm, (ey * (ax - mx) - ex * (ay - my)) / sqrt(ex * ex + ey * ey))
    weight = -motion.mass[0] * motion.gravity[2]
    stop = owners.parameters[line[START] + STOP]
    scale = 1.0 / (motion.mass[0] * max(motion.com[2] - support.height, _LOWEST))
    for i in range(3):
        row = line[FIRST] + MOST_EDGES + i
        momentum = 0.0
        for k in range(len(v)):
            momentum += motion.momentum[k, 3 + i] * v[k]
            rows.matrix[rows.first + row, k] = scale * motion.momentum[k, 3 + i]
        # A lean to the left, about -x, is stopped by pressing to the left of the component.
        up = down = arm
        if i == 0:
            up = _stopping_arm(hull, xi, (0.0, -1.0), arm)
            down = _stopping_arm(hull, xi, (0.0, 1.0), arm)
        elif i == 1:
            up = _stopping_arm(hull, xi, (1.0, 0.0), arm)
            down = _stopping_arm(hull, xi, (-1.0, 0.0), arm)
        up, down = weight * up, weight * down
        rows.upper[row] = scale * (up * max(1.0 - momentum / (up * stop), 0.0) - work[3 + i])
        rows.target[row] = scale * (-down * max(1.0 + momentum / (down * stop), 0.0) - work[3 + i])


@part
def _stopping_arm(
    hull: Float64[np.ndarray, "k 2"],
    xi: tuple[float, float],
    way: tuple[float, float],
    most: float,
) -> float:
    """Reach of the soles beyond the component, one way, which stops a lean that way [m].

    Where the component is outside, a lean that way is what brings it back.
    """
    least, count = np.inf, len(hull)
    for i in range(count):
        ax, ay = hull[i, 0], hull[i, 1]
        ex, ey = hull[(i + 1) % count, 0] - ax, hull[(i + 1) % count, 1] - ay
        along = ey * way[0] - ex * way[1]
        if along > 1e-9 * (abs(ex) + abs(ey)):
            least = min(least, (ey * (ax - xi[0]) - ex * (ay - xi[1])) / along)
    if least < 0.0:
        return min(_MOST_ARM * most, _LEAST_ARM * most - _CATCHING * least)
    return min(most, max(least, _LEAST_ARM * most))


@part
def _rank_among_nearest(
    hull: Float64[np.ndarray, "k 2"], edge: int, left: float, x: float, y: float
) -> int:
    """The place of an edge: its own, or that in the order of distance where there are too many."""
    count = len(hull)
    if count <= MOST_EDGES:
        return edge
    nearer = 0
    for i in range(count):
        ax, ay = hull[i, 0], hull[i, 1]
        ex, ey = hull[(i + 1) % count, 0] - ax, hull[(i + 1) % count, 1] - ay
        other = (ey * (ax - x) - ex * (ay - y)) / sqrt(ex * ex + ey * ey)
        if other < left or (other == left and i < edge):
            nearer += 1
    return nearer


@part
def _bound_leg(state: StateNumbers, assembly: StackNumbers, line: Line, leg: int) -> None:
    """The distance of a hip from its ankle, by its acceleration along the line between them."""
    motion, owners, rows, work = state.motion, assembly.owners, assembly.rows, assembly.work
    frames, parameters, ankle = owners.frames, owners.parameters, KINEMATICS
    hip_frame = line[FRAME_INDEX] + 2 * leg
    place_frame(motion, frames, hip_frame, work, 0)
    turn_to_world(work, 0)
    place_frame(motion, frames, hip_frame + 1, work, ankle)
    turn_to_world(work, ankle)
    x, y, z = work[0] - work[ankle], work[1] - work[ankle + 1], work[2] - work[ankle + 2]
    length = max(sqrt(x * x + y * y + z * z), 1e-6)
    x, y, z = x / length, y / length, z / length
    speed = drift = square = 0.0
    for i in range(3):
        u = x if i == 0 else y if i == 1 else z
        slip = work[VELOCITY + i] - work[ankle + VELOCITY + i]
        speed += u * slip
        square += slip * slip
        drift += u * (work[BIAS + i] - work[ankle + BIAS + i])
    drift += (square - speed * speed) / length
    at = line[START]
    torques = len(motion.columns) - BASE
    limits = int(at + TORQUES + torques + 2 * owners.chosen[line[CHOSEN] + leg])
    settings = (_ANY_SPEED, float(parameters[at + HORIZON]), float(parameters[at + BRAKING]))
    row = line[FIRST] + FIRST_LEG + leg
    rows.drift[row] = drift
    highest = largest_acceleration(parameters[limits + 1] - length, speed, _ANY_SPEED, settings)
    lowest = -largest_acceleration(length - parameters[limits], -speed, _ANY_SPEED, settings)
    if lowest > highest:
        lowest = highest = highest if speed > 0.0 else lowest
    rows.target[row], rows.upper[row] = lowest - drift, highest - drift
    _write_leg(state, assembly, hip_frame, (x, y, z), row)


@part
def _write_leg(
    state: StateNumbers,
    assembly: StackNumbers,
    hip_frame: int,
    axis: tuple[float, float, float],
    row: int,
) -> None:
    """Coefficients of a leg's length: of the joints between hip and ankle alone."""
    motion, owners, rows, work = state.motion, assembly.owners, assembly.rows, assembly.work
    frames, (x, y, z) = owners.frames, axis
    for side in range(2):
        frame, place = hip_frame + side, side * KINEMATICS
        sign = 1.0 - 2.0 * side
        for k in range(frames.starts[frame], frames.starts[frame + 1]):
            column = int(frames.columns[k])
            c = column_at(motion, column, work[place], work[place + 1], work[place + 2])
            rows.matrix[rows.first + row, column] += sign * (x * c[0] + y * c[1] + z * c[2])
