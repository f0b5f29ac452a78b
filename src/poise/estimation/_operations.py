"""`run`: operations of a filter, and of an estimator's tick, as one compiled function.

Together they take half the time to compile: most of the filter is in the tick.
"""

from poise._compiled import compiled, part, view
from poise.estimation._group import turn, turn_back
from poise.estimation._memory import (
    ACCELEROMETER,
    GYRO,
    POSITION,
    VELOCITY,
    EstimatorMemory,
    FilterMemory,
)
from poise.estimation._soles import find_airborne, see_soles, update_contacts
from poise.estimation._steps import (
    correct,
    hold,
    innovate,
    innovate_bias,
    is_sound,
    propagate,
    release,
)

PROPAGATE, HOLD, RELEASE, INNOVATE, INNOVATE_BIAS, CORRECT, CHECK = range(7)
"""Operations of a filter."""

TAKE, SEE, STEP, WAIT, JUMP = range(7, 12)
"""Operations of an estimator: check the measurements; see the soles; go on by a period, by no time,
or by more than can be integrated over."""

OK, FLYING, NO_IMU, CLOCK_JUMP, CLOCK_STILL, BAD_STATE, RESTARTED = range(7)
"""The members of `EstimatorStatus`, in their order."""

_LARGEST = 1e6
"""Larger joint values are no robot's; their squares overflow."""

_FASTEST_TURN, _HARDEST_SHOCK = 100.0, 500.0
"""Larger readings are no robot's [rad/s, m/s^2]."""


@compiled
def run(address: int, operation: int, contact: int, time: float, dt: float) -> float:
    """Run an operation of a `FilterMemory`, or of an `EstimatorMemory` and return the status."""
    if operation >= TAKE:
        m = view(EstimatorMemory, address)
        if operation == TAKE:
            return _take(m)
        see_soles(m)
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
        if not abs(m.q[i]) <= _LARGEST:
            return BAD_STATE
    for i in range(6, len(m.v)):
        if not abs(m.v[i]) <= _LARGEST:
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
        if not update_contacts(m, time, dt) and status == OK:
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
    find_airborne(m)
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
