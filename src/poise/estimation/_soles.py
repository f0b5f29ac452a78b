"""Soles of an estimator: seen by the joints, as contact points of the filter, and in the air."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.estimation._group import turn, turn_back
from poise.estimation._memory import (
    GYRO,
    OFFSET,
    SPEED,
    SPREAD,
    TURNING,
    TURNING_SPREAD,
    VELOCITY,
    EstimatorMemory,
    FilterMemory,
)
from poise.estimation._steps import correct, hold, innovate, innovate_bias, release

# Indices in `EstimatorMemory.belief`: the fields of `ContactBelief`, then others.
(
    _LOAD,
    _LOAD_WIDTH,
    _BEGIN,
    _END,
    _SPEED,
    _SPEED_WIDTH,
    _REST,
    _SLIP,
    _TURN,
    _SHAKE,
    _GATE,
    _SLIP_TIME,
    _ENCODER,
    _JOINT_VELOCITY,
    _POINT,
    _WEIGHT,
) = range(16)

_CERTAIN = 0.95
"""Probability of contact above which a sole is taken not to turn either."""

_CLEAR = 0.02
"""Height of an unloaded sole over loaded ones at which it is in the air [m]."""

_LOST_TIME, _LOST_SPEED = 0.3, 2.0
"""Time for which all soles in contact seem to move [s], after which the estimate is rather wrong
and the deviation of its velocity grows, by so much [m/s/sqrt(Hz)]."""

_ROLLING = 0.02
"""Density of the walk of a sole that leans with its leg and rolls over its edges: its middle, 5 cm
from them, goes up and down at some 5 cm/s for a fraction of a second [m/s/sqrt(Hz)]."""


@part
def see_soles(m: EstimatorMemory) -> None:
    """Fill in `seen`: position, velocities and J J^T of each sole, about the unit's origin."""
    R, p, v, axes, frames, J = m.base_R_unit, m.base_p_unit, m.v, m.axes, m.frames, m.motion.columns
    for sole in range(len(m.seen)):
        out, local = m.seen[sole], frames.placements[sole]
        place = m.motion.placements[frames.joints[sole]]
        for i in range(len(out)):
            out[i] = 0.0
        x = place[9] + place[0] * local[9] + place[3] * local[10] + place[6] * local[11]
        y = place[10] + place[1] * local[9] + place[4] * local[10] + place[7] * local[11]
        z = place[11] + place[2] * local[9] + place[5] * local[10] + place[8] * local[11]
        out[OFFSET], out[OFFSET + 1], out[OFFSET + 2] = turn_back(R, x - p[0], y - p[1], z - p[2])
        for k in range(frames.starts[sole], frames.starts[sole + 1]):
            column = frames.columns[k]
            if column < 6:
                continue
            wx, wy, wz = J[column, 3], J[column, 4], J[column, 5]
            axes[0], axes[1], axes[2] = turn_back(
                R,
                J[column, 0] + wy * z - wz * y,
                J[column, 1] + wz * x - wx * z,
                J[column, 2] + wx * y - wy * x,
            )
            axes[3], axes[4], axes[5] = turn_back(R, wx, wy, wz)
            for i in range(3):
                out[SPEED + i] += axes[i] * v[column]
                out[TURNING + i] += axes[3 + i] * v[column]
                for j in range(3):
                    out[SPREAD + 3 * i + j] += axes[i] * axes[j]
                    out[TURNING_SPREAD + 3 * i + j] += axes[3 + i] * axes[3 + j]


@part
def update_contacts(m: EstimatorMemory, time: float, dt: float) -> bool:
    """Correct the filter by soles at rest; return whether any contact is held."""
    f, b, w, held = m.filter, m.belief, m.sensed, 0
    # Less the bias that it has at the start of the tick, for all soles.
    wx, wy, wz = w[0] - f.bias[GYRO, 0], w[1] - f.bias[GYRO, 1], w[2] - f.bias[GYRO, 2]
    for contact in range(len(m.seen)):
        seen, pressed = m.seen[contact], _pressed(m, contact)
        probability = pressed * _resting(m, seen, wx, wy, wz)
        m.probability[contact] = probability
        _set_observation(f, seen[OFFSET:], seen[SPREAD:], b[_ENCODER] ** 2, b[_POINT] ** 2)
        if f.active[contact] == 0:
            if pressed > b[_BEGIN]:
                hold(f, contact)
        elif pressed < b[_END]:
            release(f, contact)
        else:
            if innovate(f, contact) <= b[_GATE]:
                correct(f)
                if probability > b[_END]:
                    m.fitted[0] = time
            else:
                # A point that cannot be at rest is held anew, as slipping.
                m.slip_end[contact] = time + b[_SLIP_TIME]
                release(f, contact)
                hold(f, contact)
            if m.fresh != 0 and probability > _CERTAIN and m.leans[contact] == 0:
                _correct_bias(m, seen, dt)
        walk = b[_SLIP]
        if not time < m.slip_end[contact]:
            walk = b[_REST] + (1.0 - probability) * (b[_SLIP] - b[_REST])
        f.contact_density[contact] = max(walk, _ROLLING) if m.leans[contact] != 0 else walk
        held += f.active[contact]
    if held == 0:
        m.fitted[0] = time
    elif time - m.fitted[0] > _LOST_TIME:
        for i in range(3, 6):
            f.P[i, i] += _LOST_SPEED * _LOST_SPEED * dt
    return held != 0


@part
def _set_observation(
    f: FilterMemory,
    x: Float64[np.ndarray, " x"],
    spread: Float64[np.ndarray, " spread"],
    joints: float,
    rest: float,
) -> None:
    """Set a measurement by the joints, its variance by J J^T and along each axis."""
    for i in range(3):
        f.offset[i] = x[i]
        for k in range(3):
            f.spread[i, k] = joints * spread[3 * i + k]
        f.spread[i, i] += rest


@part
def _correct_bias(m: EstimatorMemory, seen: Float64[np.ndarray, "27"], dt: float) -> None:
    """Correct the gyro's bias by a sole at rest, whose joints then measure the rate."""
    f, b, w = m.filter, m.belief, m.sensed
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    rest = (b[_TURN] ** 2 + b[_SHAKE] ** 2 * square) / dt
    _set_observation(f, seen[TURNING:], seen[TURNING_SPREAD:], b[_JOINT_VELOCITY] ** 2, rest)
    for i in range(3):
        f.offset[i] += w[i]
    if innovate_bias(f) <= b[_GATE]:
        correct(f)


@part
def _pressed(m: EstimatorMemory, contact: int) -> float:
    """Return the probability of contact by the normal force; 1 where none is measured."""
    b = m.belief
    if m.measured == 0:
        return 1.0
    return _logistic((m.wrenches[contact, 2] / b[_WEIGHT] - b[_LOAD]) / b[_LOAD_WIDTH])


@part
def _resting(
    m: EstimatorMemory, seen: Float64[np.ndarray, "27"], wx: float, wy: float, wz: float
) -> float:
    """Return the probability of rest by the estimated speed of a sole."""
    f, b = m.filter, m.belief
    x, y, z = seen[OFFSET], seen[OFFSET + 1], seen[OFFSET + 2]
    along, aside, up = turn(
        f.R,
        seen[SPEED] + wy * z - wz * y,
        seen[SPEED + 1] + wz * x - wx * z,
        seen[SPEED + 2] + wx * y - wy * x,
    )
    v = f.x[VELOCITY]
    along, aside, up = along + v[0], aside + v[1], up + v[2]
    speed = math.sqrt(along * along + aside * aside + up * up)
    return _logistic((b[_SPEED] - speed) / b[_SPEED_WIDTH])


@part
def _logistic(x: float) -> float:
    """Return 1 / (1 + exp(-x)) without overflow; zero for NaN."""
    if not x > -700.0:
        return 0.0
    return 1.0 / (1.0 + math.exp(-x))


@part
def find_airborne(m: EstimatorMemory) -> None:
    """Fill in the soles that are clear of the ground under others."""
    # None while none is loaded: a robot that is let down slowly touches the ground with both.
    ground = math.inf
    for sole in range(len(m.seen)):
        if m.filter.active[sole] != 0:
            ground = min(ground, _height(m, sole))
    for sole in range(len(m.seen)):
        clear = m.filter.active[sole] == 0 and _height(m, sole) - ground > _CLEAR
        m.airborne[sole] = 1 if clear else 0


@part
def _height(m: EstimatorMemory, sole: int) -> float:
    """Return the height of a sole's centre over the unit."""
    seen, R = m.seen[sole], m.filter.R
    return R[2, 0] * seen[OFFSET] + R[2, 1] * seen[OFFSET + 1] + R[2, 2] * seen[OFFSET + 2]
