"""Whether a state may be used for control at all."""

import math

import numpy as np

from poise.dynamics.state import RobotState
from poise.robots.robot import Robot

_QUATERNION_TOLERANCE = 1e-3
"""How far the base quaternion's norm may be from one; Pinocchio assumes a unit quaternion."""

_LARGEST = 1e6
"""Larger positions and speeds are no robot's [m, rad, m/s, rad/s]; their squares overflow."""


def is_usable(state: RobotState, robot: Robot) -> bool:
    """Whether sizes and types fit, numbers are finite and sane, and the base quaternion is a unit.

    Args:
        state: the state as it came.
        robot: the robot it should belong to.
    """
    q, v = state.q, state.v
    if q.shape != (robot.nq,) or v.shape != (robot.nv,) or not math.isfinite(state.time):
        return False
    # Pinocchio takes nothing else.
    if q.dtype != np.float64 or v.dtype != np.float64:
        return False
    # Half the price of isfinite().all(); NaN fails the comparison, and dot() warns of nothing.
    if not (q.dot(q) <= _LARGEST**2 and v.dot(v) <= _LARGEST**2):
        return False
    if not robot.floating_base:
        return True
    x, y, z, w = q[3:7].tolist()
    return abs(x * x + y * y + z * z + w * w - 1.0) < 2.0 * _QUATERNION_TOLERANCE
