"""Whether a state may be used for control at all."""

import math

import numpy as np

from poise.dynamics.state import RobotState
from poise.robots.robot import Robot

_QUATERNION_TOLERANCE = 1e-3
"""How far the base quaternion's norm may be from one; Pinocchio assumes a unit quaternion."""


def is_usable(state: RobotState, robot: Robot) -> bool:
    """Whether sizes fit, every number is finite and the base quaternion is a unit one.

    Args:
        state: the state as it came.
        robot: the robot it should belong to.
    """
    q, v = state.q, state.v
    if q.shape != (robot.nq,) or v.shape != (robot.nv,) or not math.isfinite(state.time):
        return False
    # A sum is finite only if every term is; half the price of isfinite().all().
    if not (math.isfinite(float(np.add.reduce(q))) and math.isfinite(float(np.add.reduce(v)))):
        return False
    if not robot.floating_base:
        return True
    x, y, z, w = q[3:7].tolist()
    return abs(x * x + y * y + z * z + w * w - 1.0) < 2.0 * _QUATERNION_TOLERANCE
