"""`Fallback`: a safe torque for the ticks that have no answer."""

import numpy as np
from jaxtyping import Float64

from poise.robots.robot import Robot

DECAY_TIME = 0.1
"""Time constant with which the last good torque fades [s]."""

DAMPING_SHARE = 0.3
"""Damping torque at a joint's velocity limit, as a share of its torque limit."""


class Fallback:
    """The last good torque, decayed towards damping of the joints; always finite and bounded.

    tau = r tau_last - (1 - r) D v with r = exp(-t / 0.1 s) since the last good command, clipped to
    the torque limits. Before any good command tau_last is zero.

    Args:
        robot: whose limits bound the torque.
    """

    def __init__(self, robot: Robot) -> None:
        self._base = robot.base_dofs
        self._limit = robot.tau_max
        self._damping = DAMPING_SHARE * robot.tau_max / robot.v_max
        self._torque = np.zeros(robot.nj)
        self._time = 0.0

    def remember(self, torque: Float64[np.ndarray, " nj"], time: float) -> None:
        """Keeps a good torque and the time it was given for [s]."""
        self._torque = torque
        self._time = time

    def torque(self, v: Float64[np.ndarray, "..."], time: float) -> Float64[np.ndarray, " nj"]:
        """The safe torque.

        Args:
            v: measured velocity, of any size and with anything in it; what is not finite or not of
                the right size counts as zero.
            time: time of the state [s]; a time that is not finite counts as far away.

        Returns:
            Joint torques [N m].
        """
        elapsed = time - self._time
        remain = float(np.exp(-max(elapsed, 0.0) / DECAY_TIME)) if np.isfinite(elapsed) else 0.0
        joints = np.zeros(len(self._limit))
        if v.shape == (self._base + len(joints),):
            np.nan_to_num(v[self._base :], nan=0.0, posinf=0.0, neginf=0.0, out=joints)
        torque = remain * self._torque - (1.0 - remain) * self._damping * joints
        return np.clip(torque, -self._limit, self._limit)
