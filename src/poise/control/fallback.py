"""`Fallback`: a safe torque for the ticks that have no answer."""

import math

import numpy as np
from jaxtyping import Float64

from poise.limits.torque import TorqueLimit
from poise.robots.robot import Robot

DECAY_TIME = 0.1
"""Time constant with which the last good torque fades [s]."""

DAMPING_SHARE = 0.3
"""Damping torque at a joint's velocity limit, as a share of its torque limit."""

_MIN_TICK = 1e-3
"""Least time that a tick without an answer counts, so that a clock that stands still, jumps back or
is not a number does not hold the last torque for ever [s]."""

_MAX_SPEED_RATIO = 1e3
"""Speed at which damping is capped, in velocity limits: far into the torque limit, and finite."""


class Fallback:
    """The last good torque, decayed towards damping of the joints; always finite and bounded.

    tau = r tau_last - (1 - r) D v with r = exp(-t / 0.1 s) since the last good command, clipped to
    the torque limits. Before any good command tau_last is zero.

    Args:
        robot: whose joints are damped.
        limit: bounds of the torque, bound to the robot.
    """

    def __init__(self, robot: Robot, limit: TorqueLimit) -> None:
        self._base = robot.base_dofs
        self._limit = limit
        self._damping = DAMPING_SHARE * robot.tau_max / robot.v_max
        self._v_cap = _MAX_SPEED_RATIO * robot.v_max
        self._torque = np.zeros(robot.nj)
        self._time = 0.0
        self._ticks = 0

    def remember(self, torque: Float64[np.ndarray, " nj"], time: float) -> None:
        """Copies a good torque, with the time it was given for [s]."""
        self._torque[:] = torque
        self._time = time
        self._ticks = 0

    def torque(self, v: Float64[np.ndarray, "..."], time: float) -> Float64[np.ndarray, " nj"]:
        """The safe torque; each call counts as a tick.

        Args:
            v: measured velocity, of any size and with anything in it; what is not finite or not of
                the right size counts as zero.
            time: time of the state [s]; where it is of no use a millisecond a tick is counted.

        Returns:
            Joint torques [N m].
        """
        self._ticks += 1
        elapsed = self._ticks * _MIN_TICK
        if math.isfinite(time):
            elapsed = max(elapsed, time - self._time)
        remain = math.exp(-elapsed / DECAY_TIME)
        joints = np.zeros(len(self._torque))
        if v.shape == (self._base + len(joints),):
            measured = v[self._base :]
            np.copyto(joints, measured, where=np.isfinite(measured))
            np.clip(joints, -self._v_cap, self._v_cap, out=joints)
        torque = remain * self._torque - (1.0 - remain) * self._damping * joints
        return np.clip(torque, self._limit.lower, self._limit.upper)
