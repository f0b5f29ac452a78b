"""`run`: operations of a filter, and of an estimator's tick, as one compiled function.

Together they take half the time to compile: most of the filter is in the tick.
"""

import math
from enum import Enum
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, part, view
from poise.dynamics import LARGEST, column_at, place_frame
from poise.estimation._group import turn, turn_back
from poise.estimation._memory import (
    ACCELEROMETER,
    GYRO,
    POSITION,
    VELOCITY,
    EstimatorMemory,
    FilterMemory,
)
from poise.estimation._steps import (
    correct,
    hold,
    innovate,
    innovate_bias,
    is_sound,
    propagate,
    release,
)


class EstimatorStatus(Enum):
    """Quality of an estimate.

    Attributes:
        OK: everything was measured and used.
        FLYING: no sole is in contact, so the inertial unit is all there is.
        NO_IMU: no usable readings of the inertial unit; the last ones replace them.
        CLOCK_JUMP: time went back, or on by more than `EstimatorConfig.longest_step`; contacts
            are reset.
        CLOCK_STILL: other readings than those of a state of the same time; they are not used.
        BAD_STATE: the measured state is none of this robot; it is returned as it is.
        RESTARTED: the filter diverged numerically, and restarts.
    """

    OK = "ok"
    FLYING = "flying"
    NO_IMU = "no imu"
    CLOCK_JUMP = "clock jump"
    CLOCK_STILL = "clock stands still"
    BAD_STATE = "bad state"
    RESTARTED = "restarted"

    @property
    def ok(self) -> bool:
        """True for `OK` and `FLYING`."""
        return self in (EstimatorStatus.OK, EstimatorStatus.FLYING)


PROPAGATE, HOLD, RELEASE, INNOVATE, INNOVATE_BIAS, CORRECT, CHECK = range(7)
"""Operations of a filter."""

TAKE, SEE, STEP, WAIT, JUMP = range(7, 12)
"""Operations of an estimator: check the measurements; see the soles; go on by a period, by no time,
or by more than can be integrated over."""

OK, FLYING, NO_IMU, CLOCK_JUMP, CLOCK_STILL, BAD_STATE, RESTARTED = range(len(EstimatorStatus))
"""The members of `EstimatorStatus`, in their order."""


_FASTEST_TURN, _HARDEST_SHOCK = 100.0, 500.0
"""Larger readings are no robot's [rad/s, m/s^2]."""

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


class _Belief(NamedTuple):
    """`EstimatorMemory.belief` by name: the fields of `ContactBelief`, then others."""

    load: float
    load_width: float
    begin: float
    end: float
    speed: float
    speed_width: float
    rest: float
    slip: float
    turn: float
    shake: float
    gate: float
    slip_time: float
    encoder: float
    joint_velocity: float
    point: float
    weight: float


@compiled
def run(address: int, operation: int, contact: int, time: float, dt: float) -> float:
    """Run an operation of a `FilterMemory`, or of an `EstimatorMemory` and return the status."""
    if operation >= TAKE:
        m = view(EstimatorMemory, address)
        if operation == TAKE:
            return _take(m)
        _see_soles(m)
        return OK if operation == SEE else _advance(m, operation, time, dt)
    f = view(FilterMemory, address)
    if operation == PROPAGATE:
        propagate(f, dt)
    elif operation == RELEASE:
        release(f, contact)
    elif operation == HOLD:
        hold(f, contact)
    elif operation == INNOVATE:
        return innovate(f, contact)
    elif operation == INNOVATE_BIAS:
        return innovate_bias(f)
    elif operation == CORRECT:
        correct(f)
    return 1.0 if is_sound(f) else 0.0


@part
def _take(m: EstimatorMemory) -> int:
    """Check joints and readings; the last readings replace unusable ones."""
    for i in range(7, len(m.q)):
        if not abs(m.q[i]) <= LARGEST:
            return BAD_STATE
    for i in range(6, len(m.v)):
        if not abs(m.v[i]) <= LARGEST:
            return BAD_STATE
    for i in range(7):
        m.q[i] = 1.0 if i == 6 else 0.0
    w, a = m.sensed[:3], m.sensed[3:]
    turning, shock = w[0] ** 2 + w[1] ** 2 + w[2] ** 2, a[0] ** 2 + a[1] ** 2 + a[2] ** 2
    # Written so that NaN fails.
    if m.fresh != 0 and turning <= _FASTEST_TURN**2 and shock <= _HARDEST_SHOCK**2:
        return OK
    m.fresh = 0
    for i in range(6):
        m.sensed[i] = m.before[i]
    return NO_IMU


@part
def _advance(m: EstimatorMemory, operation: int, time: float, dt: float) -> int:
    """Filter one measurement and find the base; return the status."""
    status = OK if m.fresh != 0 else NO_IMU
    if operation == JUMP:
        status = CLOCK_JUMP
    elif operation == STEP:
        for i in range(3):
            # The mean rate of a period is that of its two ends; the force is a mean already.
            m.filter.imu[GYRO, i] = 0.5 * (m.before[i] + m.sensed[i])
            m.filter.imu[ACCELEROMETER, i] = m.sensed[3 + i]
        propagate(m.filter, dt)
        if not _update_contacts(m, time, dt) and status == OK:
            status = FLYING
    for i in range(6):
        if operation != WAIT:
            m.before[i] = m.sensed[i]
        elif m.before[i] != m.sensed[i]:
            # The same state may come twice; other readings cannot be of the same time.
            status = CLOCK_STILL
    if not is_sound(m.filter):
        return RESTARTED
    _find_base(m)
    _find_airborne(m)
    return status


@part
def _find_base(m: EstimatorMemory) -> None:
    """Fill in the base's position in `q`, its `world_R_base`, and its velocity in `v`."""
    f, q, v, R, p, B = m.filter, m.q, m.v, m.base_R_unit, m.base_p_unit, m.world_R_base
    position, velocity, w, bias = f.x[POSITION], f.x[VELOCITY], m.before, f.bias[GYRO]
    for i in range(3):
        B[i, 0], B[i, 1], B[i, 2] = turn(R, f.R[i, 0], f.R[i, 1], f.R[i, 2])
        q[i] = position[i] - (B[i, 0] * p[0] + B[i, 1] * p[1] + B[i, 2] * p[2])
    wx, wy, wz = turn(R, w[0] - bias[0], w[1] - bias[1], w[2] - bias[2])
    v[3], v[4], v[5] = wx, wy, wz
    x, y, z = turn_back(B, velocity[0], velocity[1], velocity[2])
    # The base against the unit: omega x (-p) = p x omega.
    v[0] = x + (p[1] * wz - p[2] * wy)
    v[1] = y + (p[2] * wx - p[0] * wz)
    v[2] = z + (p[0] * wy - p[1] * wx)


@part
def _see_soles(m: EstimatorMemory) -> None:
    """Fill in position, velocities and J J^T of each sole, about the unit's origin."""
    R, p, axes, frames = m.base_R_unit, m.base_p_unit, m.axes, m.frames
    m.speed[:], m.turning[:], m.spread[:], m.turning_spread[:] = 0.0, 0.0, 0.0, 0.0
    for sole in range(len(m.place)):
        place = m.place[sole]
        place_frame(m.motion, frames, sole, m.room, 0)
        x, y, z = m.room[0], m.room[1], m.room[2]
        place[0], place[1], place[2] = turn_back(R, x - p[0], y - p[1], z - p[2])
        for k in range(frames.starts[sole], frames.starts[sole + 1]):
            column = frames.columns[k]
            if column < 6:
                continue
            vx, vy, vz, wx, wy, wz = column_at(m.motion, column, x, y, z)
            axes[0], axes[1], axes[2] = turn_back(R, vx, vy, vz)
            axes[3], axes[4], axes[5] = turn_back(R, wx, wy, wz)
            for i in range(3):
                m.speed[sole, i] += axes[i] * m.v[column]
                m.turning[sole, i] += axes[3 + i] * m.v[column]
                for j in range(3):
                    m.spread[sole, i, j] += axes[i] * axes[j]
                    m.turning_spread[sole, i, j] += axes[3 + i] * axes[3 + j]


@part
def _belief_of(m: EstimatorMemory) -> _Belief:
    b = m.belief
    return _Belief(
        *(b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]),
        *(b[8], b[9], b[10], b[11], b[12], b[13], b[14], b[15]),
    )


@part
def _update_contacts(m: EstimatorMemory, time: float, dt: float) -> bool:
    """Correct the filter by soles at rest; return whether any contact is held."""
    f, b, w, held = m.filter, _belief_of(m), m.sensed, 0
    # Less the bias that it has at the start of the tick, for all soles.
    wx, wy, wz = w[0] - f.bias[GYRO, 0], w[1] - f.bias[GYRO, 1], w[2] - f.bias[GYRO, 2]
    for contact in range(len(m.place)):
        load = m.wrenches[contact, 2] / b.weight
        # Where nothing is measured all soles press.
        pressed = 1.0 if m.measured == 0 else _logistic((load - b.load) / b.load_width)
        probability = pressed * _resting(m, contact, wx, wy, wz)
        m.probability[contact] = probability
        variance, rest = b.encoder**2, b.point**2
        _set_observation(f, m.place[contact], m.spread[contact], variance, rest)
        if f.active[contact] == 0:
            if pressed > b.begin:
                hold(f, contact)
        elif pressed < b.end:
            release(f, contact)
        else:
            if innovate(f, contact) <= b.gate:
                correct(f)
                if probability > b.end:
                    m.fitted[0] = time
            else:
                # A point that cannot be at rest gets a new anchor, as slipping.
                m.slip_end[contact] = time + b.slip_time
                release(f, contact)
                hold(f, contact)
            if m.fresh != 0 and probability > _CERTAIN and m.leans[contact] == 0:
                _correct_bias(m, contact, dt)
        walk = b.slip
        if not time < m.slip_end[contact]:
            walk = b.rest + (1.0 - probability) * (b.slip - b.rest)
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
    x: Float64[np.ndarray, "3"],
    spread: Float64[np.ndarray, "3 3"],
    joints: float,
    rest: float,
) -> None:
    """Set a measurement by the joints, its variance by J J^T and along each axis."""
    for i in range(3):
        f.offset[i] = x[i]
        for k in range(3):
            f.spread[i, k] = joints * spread[i, k]
        f.spread[i, i] += rest


@part
def _correct_bias(m: EstimatorMemory, contact: int, dt: float) -> None:
    """Correct the gyro's bias by a sole at rest, whose joints then measure the rate."""
    f, b, w = m.filter, _belief_of(m), m.sensed
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    rest = (b.turn**2 + b.shake**2 * square) / dt
    variance = b.joint_velocity**2
    _set_observation(f, m.turning[contact], m.turning_spread[contact], variance, rest)
    for i in range(3):
        f.offset[i] += w[i]
    if innovate_bias(f) <= b.gate:
        correct(f)


@part
def _resting(m: EstimatorMemory, sole: int, wx: float, wy: float, wz: float) -> float:
    """Return the probability of rest by the estimated speed of a sole."""
    f, b, u = m.filter, _belief_of(m), m.speed[sole]
    x, y, z = m.place[sole, 0], m.place[sole, 1], m.place[sole, 2]
    along, aside, up = turn(
        f.R, u[0] + wy * z - wz * y, u[1] + wz * x - wx * z, u[2] + wx * y - wy * x
    )
    v = f.x[VELOCITY]
    along, aside, up = along + v[0], aside + v[1], up + v[2]
    speed = math.sqrt(along * along + aside * aside + up * up)
    return _logistic((b.speed - speed) / b.speed_width)


@part
def _logistic(x: float) -> float:
    """Return 1 / (1 + exp(-x)) without overflow; zero for NaN."""
    if not x > -700.0:
        return 0.0
    return 1.0 / (1.0 + math.exp(-x))


@part
def _find_airborne(m: EstimatorMemory) -> None:
    """Fill in the soles that are clear of the ground under others."""
    # None while none is loaded: a robot that is let down slowly touches the ground with both.
    ground = math.inf
    for sole in range(len(m.place)):
        if m.filter.active[sole] != 0:
            ground = min(ground, _height(m, sole))
    for sole in range(len(m.place)):
        clear = m.filter.active[sole] == 0 and _height(m, sole) - ground > _CLEAR
        m.airborne[sole] = 1 if clear else 0


@part
def _height(m: EstimatorMemory, sole: int) -> float:
    """Return the height of a sole's centre over the unit."""
    place, R = m.place[sole], m.filter.R
    return R[2, 0] * place[0] + R[2, 1] * place[1] + R[2, 2] * place[2]
