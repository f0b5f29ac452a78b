"""`update_contacts`: contact points of the filter come, correct it, and go.

`find_airborne`: which soles are clear of the ground.
"""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.estimation._correction import correct, hold, innovate, innovate_bias, release
from poise.estimation._group import turn
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

# Where the numbers of `EstimatorMemory.belief` stand: those of `ContactBelief`, then others.
(
    _LOAD,
    _LOAD_WIDTH,
    _BEGIN,
    _END,
    _SPEED,
    _SPEED_WIDTH,
    _REST,
    _TURN,
    _SHAKE,
    _SLIP,
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
"""A sole that carries nothing and is so high above those that do is in the air [m]."""

_LOST_TIME, _LOST_SPEED = 0.3, 2.0
"""Where all soles in contact seem to move for so long [s], it is rather the estimate that is wrong,
and its velocity becomes less sure from then on, by so much [m/s/sqrt(Hz)]."""

_ROLLING = 0.02
"""Density of the walk of a sole that leans with its leg and rolls over its edges: its middle is
5 cm from them, goes up and down at some 5 cm/s for a fraction of a second [m/s/sqrt(Hz)]."""


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
                # A point that cannot be at rest is put down anew, as slipping.
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
    """Set what the joints say, with their variance through J J^T and a variance along each axis."""
    for i in range(3):
        f.offset[i] = x[i]
        for k in range(3):
            f.spread[i, k] = joints * spread[3 * i + k]
        f.spread[i, i] += rest


@part
def _correct_bias(m: EstimatorMemory, seen: Float64[np.ndarray, "27"], dt: float) -> None:
    """Correct the gyro's bias by a sole at rest: it does not turn, so the joints tell the rate."""
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
    """Probability of contact by the normal force; all are pressed where none is measured."""
    b = m.belief
    if m.measured == 0:
        return 1.0
    return _logistic((m.wrenches[contact, 2] / b[_WEIGHT] - b[_LOAD]) / b[_LOAD_WIDTH])


@part
def _resting(
    m: EstimatorMemory, seen: Float64[np.ndarray, "27"], wx: float, wy: float, wz: float
) -> float:
    """Probability of rest by the speed that the estimate gives a sole."""
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
    """1 / (1 + exp(-x)) without overflow; zero for NaN."""
    if not x > -700.0:
        return 0.0
    return 1.0 / (1.0 + math.exp(-x))


@part
def find_airborne(m: EstimatorMemory) -> None:
    """Fill in which soles are clear of the ground that others stand on."""
    # None while none carries: a robot that is let down slowly touches the ground with both.
    ground = math.inf
    for sole in range(len(m.seen)):
        if m.filter.active[sole] != 0:
            ground = min(ground, _height(m, sole))
    for sole in range(len(m.seen)):
        clear = m.filter.active[sole] == 0 and _height(m, sole) - ground > _CLEAR
        m.airborne[sole] = 1 if clear else 0


@part
def _height(m: EstimatorMemory, sole: int) -> float:
    """Height of a sole's centre over the unit."""
    seen, R = m.seen[sole], m.filter.R
    return R[2, 0] * seen[OFFSET] + R[2, 1] * seen[OFFSET + 1] + R[2, 2] * seen[OFFSET + 2]
