"""`run`: operations of a filter, and of an estimator's tick, as one compiled function.

Together they take half the time to compile: most of the filter is in the tick.
"""

from poise._compiled import compiled, part, view
from poise.estimation._base import find_base
from poise.estimation._correction import correct, hold, innovate, innovate_bias, release
from poise.estimation._memory import (
    ACCELEROMETER,
    GYRO,
    EstimatorMemory,
    FilterMemory,
    is_sound,
)
from poise.estimation._propagation import propagate
from poise.estimation._sole_contacts import find_airborne, update_contacts
from poise.estimation._soles import see_soles

PROPAGATE, HOLD, RELEASE, INNOVATE, INNOVATE_BIAS, CORRECT, CHECK = range(7)
"""Operations of a filter."""

TAKE, SEE, STEP, WAIT, JUMP = range(7, 12)
"""Operations of an estimator: look at what was measured; see the soles; go on by a period, by no
time, or by more than can be known of."""

OK, FLYING, NO_IMU, CLOCK_JUMP, CLOCK_STILL, BAD_STATE, RESTARTED = range(7)
"""The members of `EstimatorStatus`, in their order."""

_LARGEST = 1e6
"""Larger numbers are no robot's; their squares overflow."""

_FASTEST_TURN, _HARDEST_SHOCK = 100.0, 500.0
"""No unit on a robot measures more [rad/s, m/s^2]; one that says so says nothing."""


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
def _advance(m: EstimatorMemory, operation: int, time: float, dt: float) -> int:
    """Take one measurement into the filter, and find the base; returns the status."""
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
    find_base(m)
    find_airborne(m)
    return status


@part
def _take(m: EstimatorMemory) -> int:
    """Look at joints and readings; the last ones stand in for readings of no use."""
    for i in range(7, len(m.q)):
        if not abs(m.q[i]) <= _LARGEST:
            return BAD_STATE
    for i in range(6, len(m.v)):
        if not abs(m.v[i]) <= _LARGEST:
            return BAD_STATE
    for i in range(7):
        m.q[i] = 1.0 if i == 6 else 0.0
    w, a = m.sensed[:3], m.sensed[3:]
    turn, shock = w[0] ** 2 + w[1] ** 2 + w[2] ** 2, a[0] ** 2 + a[1] ** 2 + a[2] ** 2
    # Written so that NaN fails.
    if m.fresh != 0 and turn <= _FASTEST_TURN**2 and shock <= _HARDEST_SHOCK**2:
        return OK
    m.fresh = 0
    for i in range(6):
        m.sensed[i] = m.before[i]
    return NO_IMU
