"""Whether a state may be used for control at all."""

import math
from typing import Any, cast

import numpy as np
from scipy.linalg import blas

from poise.dynamics import RobotState
from poise.robots import Robot

_norm: Any = cast("Any", blas).dnrm2  # SciPy's stubs do not know the wrapped routines

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
    # NaN fails the comparison; and unlike NumPy's sums and products nrm2 never warns of overflow.
    if not (_norm(q) <= _LARGEST and _norm(v) <= _LARGEST):
        return False
    if not robot.floating_base:
        return True
    x, y, z, w = q[3:7].tolist()
    return abs(x * x + y * y + z * z + w * w - 1.0) < 2.0 * _QUATERNION_TOLERANCE


def _is_vector(value: object, size: int) -> bool:
    # Pinocchio takes nothing but doubles.
    return isinstance(value, np.ndarray) and value.shape == (size,) and value.dtype == np.float64


def _is_time(value: object) -> bool:
    return isinstance(value, float | int) and math.isfinite(value)
