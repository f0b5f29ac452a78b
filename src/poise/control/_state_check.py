"""Whether a state may be used for control at all."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled
from poise.dynamics import RobotState
from poise.robots import Robot

_QUATERNION_TOLERANCE = 1e-3
"""How far the base quaternion's norm may be from one; Pinocchio assumes a unit quaternion."""

_LARGEST = 1e6
"""Larger positions and speeds are no robot's [m, rad, m/s, rad/s]; their squares overflow."""


def is_usable(state: object, robot: Robot) -> bool:
    """Whether kinds and sizes fit, numbers are finite and sane, and the base quaternion is a unit.

    Args:
        state: the state as it came.
        robot: the robot it should belong to.
    """
    if not isinstance(state, RobotState):
        return False
    q, v = state.q, state.v
    if not (_is_vector(q, robot.nq) and _is_vector(v, robot.nv) and _is_time(state.time)):
        return False
    # Copies: whatever layout came, compiled code is made for one.
    return _is_sane(np.array(q), np.array(v), robot.floating_base)


@compiled
def _is_sane(
    q: Float64[np.ndarray, " nq"], v: Float64[np.ndarray, " nv"], floating_base: bool
) -> bool:
    """Written so that NaN fails every comparison."""
    for numbers in (q, v):
        for i in range(len(numbers)):
            if not abs(numbers[i]) <= _LARGEST:
                return False
    if not floating_base:
        return True
    square = q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6]
    return abs(square - 1.0) < 2.0 * _QUATERNION_TOLERANCE


def _is_vector(value: object, size: int) -> bool:
    # Pinocchio takes nothing but doubles.
    return isinstance(value, np.ndarray) and value.shape == (size,) and value.dtype == np.float64


def _is_time(value: object) -> bool:
    return isinstance(value, float | int) and math.isfinite(value)
