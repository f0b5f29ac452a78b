"""The formulas of tasks and contacts, compiled: what each kind writes into the rows of a stack."""

import math

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled, part, view
from poise.dynamics import (
    BIAS,
    KINEMATICS,
    ROTATION,
    VELOCITY,
    Motion,
    StateNumbers,
    column_at,
    momentum_rate,
    place_frame,
    sine_between,
    turn_between,
    turn_to_world,
)
from poise.stack._balance_kernels import bound_balance
from poise.stack._self_collision_kernels import bound_self_collision
from poise.stack._tables import (
    ACCELERATION,
    BALANCE,
    CHOSEN,
    COM,
    CONTACT,
    COUNT,
    FIRST,
    FRAME,
    FRAME_INDEX,
    GAINS,
    GIVEN_VELOCITY,
    JOINTS,
    KD,
    KIND,
    KP,
    MOMENTUM,
    OWN_AXES,
    RATE,
    ROOT_INDEX,
    SELF_COLLISION,
    SINE,
    SPEED,
    START,
    TARGET_ACCELERATION,
    TARGET_ROTATION,
    TARGET_VELOCITY,
    TURNS,
    WEIGHT,
    Assembly,
    Numbers,
    Owners,
    Rows,
)

_HUGE = 1e150
"""Speeds are cut to this, whose square does not overflow."""

_STEEPNESS = 4.0
"""Slope at which feedback fades near half a turn, over that of the error: kd^2 / kp of critical
damping, with which the velocity asked for changes by kd a radian, as fast as damping follows."""

_FADING = math.pi * _STEEPNESS / (1.0 + _STEEPNESS)
"""Angle from which on the feedback of an orientation error fades [rad]."""

FULL_TILT = 0.01
"""A sole that leans and is tilted by this much stands on its edge alone [rad]."""


@compiled
def evaluate(assembly_at: int, state_at: int, velocities: bool) -> bool:
    """Writes the rows of all owners for one state; returns False where a target is missing."""
    assembly, state = view(Assembly, assembly_at), view(StateNumbers, state_at)
    q, v, motion = state.q, state.v, state.motion
    owners, rows, work = assembly.owners, assembly.rows, assembly.work
    _gather(owners)
    for i in range(assembly.count):
        line = owners.lines[i]
        kind, target = int(line[KIND]), int(line[START] + GAINS * line[COUNT])
        if kind == CONTACT:
            _contact(motion, owners, line, rows, velocities, work)
            continue
        if kind == BALANCE:
            bound_balance(v, motion, owners, line, rows, work)
            continue
        if kind == SELF_COLLISION:
            bound_self_collision(motion, owners, line, rows, velocities, work)
            continue
        parameters = owners.parameters
        if np.isnan(parameters[target]):
            return False
        if line[TURNS] and np.isnan(parameters[target + TARGET_ROTATION]):
            return False
        if kind == COM:
            _com(v, motion, owners, line, rows, velocities, work)
        elif kind == MOMENTUM:
            _momentum(v, motion, owners, line, rows, velocities, work)
        elif kind == JOINTS:
            _joints(q, v, owners, line, rows, velocities)
        elif kind == FRAME:
            _frame(motion, owners, line, rows, velocities, work)
        else:
            _relative_frame(motion, owners, line, rows, velocities, work)
    return True


@part
def _gather(owners: Owners) -> None:
    """Copies the parameters of all owners."""
    at = 0
    for place in owners.places:
        numbers = view(Numbers, place).all
        for k in range(len(numbers)):
            owners.parameters[at + k] = numbers[k]
        at += len(numbers)


@part
def _write(
    rows: Rows,
    parameters: Float64[np.ndarray, " p"],
    line: Int64[np.ndarray, " entries"],
    i: int,
    error: float,
    fade: float,
    velocity: float,
    actual: float,
    feedforward: float,
    drift: float,
) -> None:
    """Write what a task's row measures; `target` holds the target's velocity until `_ask`."""
    row = line[FIRST] + i
    rows.error[row], rows.fade[row], rows.error_rate[row] = error, fade, velocity - actual
    rows.drift[row], rows.feedforward[row] = drift, feedforward
    rows.target[row] = velocity
    rows.weight[row] = parameters[line[START] + WEIGHT * line[COUNT] + i]


@part
def _ask(
    rows: Rows,
    parameters: Float64[np.ndarray, " p"],
    line: Int64[np.ndarray, " entries"],
    begin: int,
    end: int,
    velocities: bool,
) -> None:
    """Feedback of a block of a task's rows as in `Task`, or what was given in its place."""
    m, gains, first = line[COUNT], line[START], line[FIRST]
    asked_square = target_square = 0.0
    for i in range(begin, end):
        kd, rate = parameters[gains + KD * m + i], parameters[gains + RATE * m + i]
        if kd > 0.0 and rate > 0.0:
            velocity = min(max(rows.target[first + i], -_HUGE), _HUGE)
            asked = velocity + rate * rows.fade[first + i] * rows.error[first + i]
            asked = min(max(asked, -_HUGE), _HUGE)
            asked_square += asked * asked
            target_square += velocity * velocity
    part = 1.0
    if asked_square > target_square:
        speed = max(parameters[gains + SPEED * m + begin], math.sqrt(target_square))
        part = min(speed / math.sqrt(asked_square), 1.0)
    for i in range(begin, end):
        row = first + i
        kp, kd = parameters[gains + KP * m + i], parameters[gains + KD * m + i]
        rate = parameters[gains + RATE * m + i]
        error, velocity = rows.fade[row] * rows.error[row], rows.target[row]
        asked = velocity + rate * error
        reference = kp * error + kd * rows.error_rate[row] + rows.feedforward[row]
        if part < 1.0 and kd > 0.0 and rate > 0.0:
            actual = velocity - rows.error_rate[row]
            asked = part * min(max(asked, -_HUGE), _HUGE)
            reference = kd * (asked - actual) + rows.feedforward[row]
        given = parameters[gains + ACCELERATION * m + i]
        if not np.isnan(given):
            reference = given
        given = parameters[gains + GIVEN_VELOCITY * m + i]
        if not np.isnan(given):
            asked = given
        rows.reference[row] = reference
        rows.target[row] = rows.upper[row] = asked if velocities else reference - rows.drift[row]


@part
def _contact(
    motion: Motion,
    owners: Owners,
    line: Int64[np.ndarray, " entries"],
    rows: Rows,
    velocities: bool,
    work: Float64[np.ndarray, " work"],
) -> None:
    """A contact's frame along its own axes, or its edge; parameters as `Contact` lays them out."""
    frame, first, m = line[FRAME_INDEX], line[FIRST], line[COUNT]
    frames, parameters, at = owners.frames, owners.parameters, line[START]
    place_frame(motion, frames, frame, work, 0)
    _move_to_edge(parameters, at + 3 + 2 * m, work)
    for k in range(frames.starts[frame], frames.starts[frame + 1]):
        column = int(frames.columns[k])
        x = column_at(motion, column, work[0], work[1], work[2])
        for i in range(m):
            # Linear rows along the frame's axes, then angular ones.
            component = int(owners.chosen[line[CHOSEN] + i])
            o, axis = 3 * (component // 3), ROTATION + component % 3
            rows.matrix[rows.first + first + i, column] = (
                work[axis] * x[o] + work[axis + 3] * x[o + 1] + work[axis + 6] * x[o + 2]
            )
    for i in range(m):
        component = int(owners.chosen[line[CHOSEN] + i])
        drift, asks = work[BIAS + component], parameters[at + 4 + 2 * m + i]
        reference = asks - parameters[at] * work[VELOCITY + component]
        rows.drift[first + i], rows.reference[first + i] = drift, reference
        asked = 0.0 if velocities else reference - drift
        rows.target[first + i] = rows.upper[first + i] = asked
        rows.wrench_lower[first + i] = parameters[at + 1 + i]
        rows.wrench_upper[first + i] = parameters[at + 1 + m + i]


@part
def _move_to_edge(
    parameters: Float64[np.ndarray, " p"], edge: int, work: Float64[np.ndarray, " work"]
) -> None:
    """Moves a frame aside to the lower edge of its sole, along its y, with velocity and bias."""
    tilt = work[ROTATION + 7]
    aside = -parameters[edge] * min(max(tilt / FULL_TILT, -1.0), 1.0)
    for i in range(3):
        work[i] += aside * work[ROTATION + 3 * i + 1]
    wx, wy, wz = work[VELOCITY + 3], work[VELOCITY + 4], work[VELOCITY + 5]
    work[VELOCITY] -= aside * wz
    work[VELOCITY + 2] += aside * wx
    work[BIAS] += aside * (wx * wy - work[BIAS + 5])
    work[BIAS + 1] -= aside * (wx * wx + wz * wz)
    work[BIAS + 2] += aside * (wy * wz + work[BIAS + 3])


@part
def _com(
    v: Float64[np.ndarray, " nv"],
    motion: Motion,
    owners: Owners,
    line: Int64[np.ndarray, " entries"],
    rows: Rows,
    velocities: bool,
    work: Float64[np.ndarray, " work"],
) -> None:
    """The COM; its Jacobian and drift are the linear momentum's over the mass."""
    parameters, m = owners.parameters, line[COUNT]
    momentum_rate(motion, work, 0)
    for i in range(m):
        axis = int(owners.chosen[line[CHOSEN] + i])
        row = int(rows.first + line[FIRST]) + i
        actual = _write_momentum_row(v, motion, axis, motion.mass[0], rows, row)
        target = int(line[START] + GAINS * m) + axis
        velocity = parameters[target + 3]
        _write(
            rows,
            parameters,
            line,
            i,
            parameters[target] - motion.com[axis],
            1.0,
            velocity,
            actual,
            parameters[target + 6],
            work[axis] / motion.mass[0],
        )
    _ask(rows, parameters, line, 0, m, velocities)


@part
def _momentum(
    v: Float64[np.ndarray, " nv"],
    motion: Motion,
    owners: Owners,
    line: Int64[np.ndarray, " entries"],
    rows: Rows,
    velocities: bool,
    work: Float64[np.ndarray, " work"],
) -> None:
    """The angular momentum about the COM; its target's first rate is the feedforward."""
    parameters, m = owners.parameters, line[COUNT]
    momentum_rate(motion, work, 0)
    for i in range(m):
        axis = int(owners.chosen[line[CHOSEN] + i])
        row = int(rows.first + line[FIRST]) + i
        actual = _write_momentum_row(v, motion, 3 + axis, 1.0, rows, row)
        target = int(line[START] + GAINS * m) + axis
        momentum = parameters[target]
        _write(
            rows,
            parameters,
            line,
            i,
            momentum - actual,
            1.0,
            momentum,
            actual,
            parameters[target + 3],
            work[3 + axis],
        )
    _ask(rows, parameters, line, 0, m, velocities)


@part
def _write_momentum_row(
    v: Float64[np.ndarray, " nv"],
    motion: Motion,
    component: int,
    divisor: float,
    rows: Rows,
    row: int,
) -> float:
    """A row of the centroidal momentum map A_G over a divisor; returns its product with v."""
    actual = 0.0
    for k in range(len(v)):
        x = motion.momentum[k, component] / divisor
        rows.matrix[row, k] = x
        actual += x * v[k]
    return actual


@part
def _joints(
    q: Float64[np.ndarray, " nq"],
    v: Float64[np.ndarray, " nv"],
    owners: Owners,
    line: Int64[np.ndarray, " entries"],
    rows: Rows,
    velocities: bool,
) -> None:
    """Single joints, whose coefficients are constant and stand there already."""
    parameters, m = owners.parameters, int(line[COUNT])
    for i in range(m):
        joint = int(owners.chosen[line[CHOSEN] + i])
        target = int(line[START] + GAINS * m) + i
        _write(
            rows,
            parameters,
            line,
            i,
            parameters[target] - q[joint + len(q) - len(v)],
            1.0,
            parameters[target + m],
            v[joint],
            parameters[target + 2 * m],
            0.0,
        )
        _ask(rows, parameters, line, i, i + 1, velocities)


@part
def _frame(
    motion: Motion,
    owners: Owners,
    line: Int64[np.ndarray, " entries"],
    rows: Rows,
    velocities: bool,
    work: Float64[np.ndarray, " work"],
) -> None:
    """A frame's pose along the world's axes."""
    frame, m, error = line[FRAME_INDEX], line[COUNT], KINEMATICS
    frames, parameters = owners.frames, owners.parameters
    target = int(line[START] + GAINS * m)
    place_frame(motion, frames, frame, work, 0)
    turn_to_world(work, 0)
    for i in range(3):
        work[error + i] = parameters[target + i] - work[i]
    fade = 1.0
    if line[SINE]:
        sine_between(parameters, target + TARGET_ROTATION, work, ROTATION, work, error + 3)
    elif line[TURNS]:
        turn_between(parameters, target + TARGET_ROTATION, work, ROTATION, work, error + 3)
        fade = _fade(work, error + 3)
    linear = 0
    for k in range(frames.starts[frame], frames.starts[frame + 1]):
        column = int(frames.columns[k])
        x = column_at(motion, column, work[0], work[1], work[2])
        for i in range(m):
            component = int(owners.chosen[line[CHOSEN] + i])
            if component < OWN_AXES:
                coefficient = x[component]
            else:
                axis = ROTATION + component - OWN_AXES
                coefficient = work[axis] * x[3] + work[axis + 3] * x[4] + work[axis + 6] * x[5]
            rows.matrix[rows.first + line[FIRST] + i, column] = coefficient
    for i in range(m):
        component = int(owners.chosen[line[CHOSEN] + i])
        linear += component < 3
        _write(
            rows,
            parameters,
            line,
            i,
            _along(work, error, component, work),
            1.0 if component < 3 else fade,
            _along(parameters, target + TARGET_VELOCITY, component, work),
            _along(work, VELOCITY, component, work),
            _along(parameters, target + TARGET_ACCELERATION, component, work),
            _along(work, BIAS, component, work),
        )
    _ask(rows, parameters, line, 0, linear, velocities)
    _ask(rows, parameters, line, linear, m, velocities)


@part
def _fade(turn: Float64[np.ndarray, " k"], at: int) -> float:
    """Part of a rotation vector of angle phi that is fed back, min(phi, 4 (pi - phi)) / phi."""
    x, y, z = turn[at], turn[at + 1], turn[at + 2]
    angle = math.sqrt(x * x + y * y + z * z)
    return 1.0 if angle <= _FADING else max(_STEEPNESS * (math.pi - angle) / angle, 0.0)


@part
def _along(
    twist: Float64[np.ndarray, " k"], at: int, component: int, work: Float64[np.ndarray, " work"]
) -> float:
    """A component of a twist: along an axis of the world, or about one of the frame's own."""
    if component < OWN_AXES:
        return twist[at + component]
    axis = ROTATION + component - OWN_AXES
    return (
        work[axis] * twist[at + 3] + work[axis + 3] * twist[at + 4] + work[axis + 6] * twist[at + 5]
    )


@part
def _relative_frame(
    motion: Motion,
    owners: Owners,
    line: Int64[np.ndarray, " entries"],
    rows: Rows,
    velocities: bool,
    work: Float64[np.ndarray, " work"],
) -> None:
    """A frame's pose as seen from another, along the other's axes; targets are at rest."""
    m, other, error = line[COUNT], KINEMATICS, 2 * KINEMATICS
    parameters, target = owners.parameters, int(line[START] + GAINS * m)
    place_frame(motion, owners.frames, line[FRAME_INDEX], work, 0)
    turn_to_world(work, 0)
    place_frame(motion, owners.frames, line[ROOT_INDEX], work, other)
    turn_to_world(work, other)
    _relative_columns(motion, owners, line, rows, work)
    _see_from(work, other)
    for i in range(3):
        work[error + i] = parameters[target + i] - work[i]
    fade = 1.0
    if line[TURNS]:
        turn_between(parameters, target + TARGET_ROTATION, work, ROTATION, work, error + 3)
        fade = _fade(work, error + 3)
    linear = 0
    for i in range(m):
        component = int(owners.chosen[line[CHOSEN] + i])
        linear += component < 3
        _write(
            rows,
            parameters,
            line,
            i,
            work[error + component],
            1.0 if component < 3 else fade,
            0.0,
            work[VELOCITY + component],
            0.0,
            work[BIAS + component],
        )
    _ask(rows, parameters, line, 0, linear, velocities)
    _ask(rows, parameters, line, linear, m, velocities)


@part
def _relative_columns(
    motion: Motion,
    owners: Owners,
    line: Int64[np.ndarray, " entries"],
    rows: Rows,
    work: Float64[np.ndarray, " work"],
) -> None:
    """Coefficients of a frame's motion seen from a root: of the joints between the two alone."""
    frames, R, m = owners.frames, KINEMATICS + ROTATION, line[COUNT]
    starts, columns = frames.starts, frames.columns
    one, other = starts[line[FRAME_INDEX]], starts[line[ROOT_INDEX]]
    one_end, other_end = starts[line[FRAME_INDEX] + 1], starts[line[ROOT_INDEX] + 1]
    # What moves both stands first in either list, and moves neither against the other.
    while one < one_end and other < other_end and columns[one] == columns[other]:
        one, other = one + 1, other + 1
    for k in range(one_end - one + other_end - other):
        ahead = k < one_end - one
        column = int(columns[one + k] if ahead else columns[other + k - (one_end - one)])
        # A root that turns carries the point where the frame is with it.
        x = column_at(motion, column, work[0], work[1], work[2])
        sign = 1.0 if ahead else -1.0
        for i in range(m):
            component = int(owners.chosen[line[CHOSEN] + i])
            o, axis = 3 * (component // 3), R + component % 3
            seen = work[axis] * x[o] + work[axis + 3] * x[o + 1] + work[axis + 6] * x[o + 2]
            rows.matrix[rows.first + line[FIRST] + i, column] = sign * seen


@part
def _see_from(work: Float64[np.ndarray, " work"], root: int) -> None:
    """Turns a frame's place and motion in the world into those seen from a root, in its axes.

    With offset p_f - p_r and slip v_f - v_r, the velocity seen is slip - omega_r x offset, and the
    drift carries the centripetal and Coriolis terms of the turning root.
    """
    w = root + VELOCITY + 3
    for i in range(3):
        work[i] -= work[root + i]
    for i in range(6):
        work[VELOCITY + i] -= work[root + VELOCITY + i]
        work[BIAS + i] -= work[root + BIAS + i]
    _subtract_cross(work, root + BIAS + 3, 0, BIAS)
    _subtract_cross(work, w, VELOCITY, BIAS)
    _subtract_cross(work, w, 0, VELOCITY)
    _subtract_cross(work, w, VELOCITY, BIAS)
    _subtract_cross(work, w, VELOCITY + 3, BIAS + 3)
    R = root + ROTATION
    for first in (0, VELOCITY, VELOCITY + 3, BIAS, BIAS + 3):
        _turn_back(work, R, first, 1)
    for column in range(3):
        _turn_back(work, R, ROTATION + column, 3)


@part
def _subtract_cross(work: Float64[np.ndarray, " work"], a: int, b: int, out: int) -> None:
    """Out -= a x b."""
    ax, ay, az, bx, by, bz = (
        work[a],
        work[a + 1],
        work[a + 2],
        work[b],
        work[b + 1],
        work[b + 2],
    )
    work[out] -= ay * bz - az * by
    work[out + 1] -= az * bx - ax * bz
    work[out + 2] -= ax * by - ay * bx


@part
def _turn_back(work: Float64[np.ndarray, " work"], R: int, at: int, step: int) -> None:
    """R^T times a vector, in place; its components stand a step apart."""
    x, y, z = work[at], work[at + step], work[at + 2 * step]
    for i in range(3):
        work[at + i * step] = work[R + i] * x + work[R + 3 + i] * y + work[R + 6 + i] * z
