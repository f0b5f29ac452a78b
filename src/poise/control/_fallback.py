"""`VelocityFallback`: safe joint velocities for the ticks that have no answer.

`Fading`: how much of the last good command is left, whatever the clock does.
`Fallback`: a safe torque for the ticks that have no answer.
"""

import math

import numpy as np
from jaxtyping import Float64

from poise.robots import Robot
from poise.stack import TorqueLimit

_MIN_TICK = 1e-3
"""Least time that a tick without an answer counts, so that a clock that stands still, jumps back or
is not a number does not hold the last command for ever [s]."""


class Fading:
    """A share that falls from one as exp(-t / decay time) since the last good command.

    Args:
        decay_time: time constant [s].
    """

    def __init__(self, decay_time: float) -> None:
        self._decay_time = decay_time
        self._time = 0.0
        self._ticks = 0

    def restart(self, time: float) -> None:
        """A good command was given, at a time [s]."""
        self._time = time
        self._ticks = 0

    def tick(self, time: object) -> float:
        """The share that is left; each call counts as a tick.

        Args:
            time: time of the state [s]; where it is of no use a millisecond a tick is counted.
        """
        self._ticks += 1
        elapsed = self._ticks * _MIN_TICK
        if isinstance(time, float | int) and math.isfinite(time):
            elapsed = max(elapsed, time - self._time)
        return math.exp(-elapsed / self._decay_time)


DECAY_TIME = 0.1
"""Time constant with which the last good torque fades [s]."""

DAMPING_SHARE = 0.3
"""Damping torque at a joint's velocity limit, as a share of its torque limit."""


class Fallback:
    """The last good torque, decayed towards damping of the joints; always finite and bounded.

    tau = r tau_last - (1 - r) D v with r = exp(-t / 0.1 s) since the last good command; v and tau
    are clipped to the joints' limits. Before any good command tau_last is zero.

    Args:
        robot: whose joints are damped.
        limit: bounds of the torque, bound to the robot.
    """

    def __init__(self, robot: Robot, limit: TorqueLimit) -> None:
        self._base = robot.base_dofs
        self._limit = limit
        self._damping = DAMPING_SHARE * robot.tau_max / robot.v_max
        self._v_max = robot.v_max
        self._torque = np.zeros(robot.nj)
        self._fading = Fading(DECAY_TIME)

    def remember(self, torque: Float64[np.ndarray, " nj"], time: float) -> None:
        """Copies a good torque, with the time it was given for [s]."""
        self._torque[:] = torque
        self._fading.restart(time)

    def torque(self, v: object, time: object) -> Float64[np.ndarray, " nj"]:
        """The safe torque; each call counts as a tick.

        Args:
            v: measured velocity, or whatever came in its place; what is not finite or not an array
                of the right size counts as zero.
            time: time of the state [s]; where it is of no use a millisecond a tick is counted.

        Returns:
            Joint torques [N m].
        """
        remain = self._fading.tick(time)
        joints = np.zeros(len(self._torque))
        size = self._base + len(joints)
        if isinstance(v, np.ndarray) and v.shape == (size,) and v.dtype.kind in "fiu":
            measured = v[self._base :]
            np.copyto(joints, measured, where=np.isfinite(measured))
            # A speed that no joint can have must not ask for full torque.
            np.clip(joints, -self._v_max, self._v_max, out=joints)
        torque = remain * self._torque - (1.0 - remain) * self._damping * joints
        return np.clip(torque, self._limit.lower, self._limit.upper)


STOP_TIME = 0.05
"""Time constant with which the last good velocities fade to a stop [s]."""


class VelocityFallback:
    """The last good joint velocities, decayed to zero; always finite and bounded.

    Args:
        robot: the robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._velocity = np.zeros(robot.nj)
        self._fading = Fading(STOP_TIME)

    def remember(self, velocity: Float64[np.ndarray, " nj"], time: float) -> None:
        """Copies good velocities, with the time they were given for [s]."""
        self._velocity[:] = velocity
        self._fading.restart(time)

    def velocity(self, time: object) -> Float64[np.ndarray, " nj"]:
        """The safe velocities [rad/s]; each call counts as a tick.

        Args:
            time: time of the state [s], or whatever came in its place.
        """
        return self._fading.tick(time) * self._velocity
