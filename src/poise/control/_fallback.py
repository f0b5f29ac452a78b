"""`Fallback`: a safe command for the ticks that have no answer.

`RateLimit`: bound on the change of a command from tick to tick.
"""

import math

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, is_time
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import TorqueLimit

_MIN_TICK = 1e-3
"""Least time that a tick without an answer counts, so that a clock that stands still, jumps back or
is not a number does not hold the last command for ever [s]."""

DECAY_TIME = 0.1
"""Time constant with which the last good torque decays [s]."""

DAMPING_RATIO = 0.3
"""Damping torque at a joint's velocity limit, by its torque limit."""

STOP_TIME = 0.05
"""Time constant with which the last good velocities decay to a stop [s]."""


class Fallback:
    """The last good command, decayed towards a safe one; always finite and bounded.

    u = r u_last - (1 - r) D v with r = exp(-t / T) since the last good command; v is clipped to the
    joints' velocity limits and u to its own bounds. Before any good command u_last is zero. Torques
    decay towards damping, velocities, with D = 0, to a stop.
    """

    def __init__(
        self,
        robot: Robot,
        decay_time: float,
        damping: Float64[np.ndarray, " nj"],
        lower: Float64[np.ndarray, " nj"],
        upper: Float64[np.ndarray, " nj"],
    ) -> None:
        self._base, self._v_max = robot.base_dofs, robot.v_max
        self._decay_time, self._damping = decay_time, damping
        self._lower, self._upper = lower, upper
        self._last = np.zeros(robot.nj)
        self.reset()

    @staticmethod
    def of_torque(robot: Robot, limit: TorqueLimit) -> "Fallback":
        """Make one of torques, which decay towards damping of the joints."""
        damping = DAMPING_RATIO * robot.tau_max / robot.v_max
        return Fallback(robot, DECAY_TIME, damping, limit.lower, limit.upper)

    @staticmethod
    def of_velocity(robot: Robot) -> "Fallback":
        """Make one of velocities, which decay to a stop."""
        unbounded = np.full(robot.nj, np.inf)
        return Fallback(robot, STOP_TIME, np.zeros(robot.nj), -unbounded, unbounded)

    def reset(self) -> None:
        """Forget the last good command."""
        self._last[:] = 0.0
        self._time, self._elapsed = 0.0, 0.0

    def remember(self, command: Float64[np.ndarray, " nj"], time: float) -> None:
        """Copy a good command, with the time of its state [s]."""
        self._last[:] = command
        self._time, self._elapsed = time, 0.0

    def command(self, state: object) -> Float64[np.ndarray, " nj"]:
        """Return the safe command; each call counts as a tick."""
        v, time = (state.v, state.time) if isinstance(state, RobotState) else (None, None)
        ratio = self._ratio(time)
        command = ratio * self._last - (1.0 - ratio) * self._damping * self._joint_velocities(v)
        return np.clip(command, self._lower, self._upper)

    def _ratio(self, time: object) -> float:
        """Return the share of the last good command."""
        # Never less than before: a clock that goes back brings no torque back.
        self._elapsed += _MIN_TICK
        if is_time(time):
            self._elapsed = max(self._elapsed, time - self._time)
        return math.exp(-self._elapsed / self._decay_time)

    def _joint_velocities(self, v: object) -> Float64[np.ndarray, " nj"]:
        joints = np.zeros(len(self._last))
        size = self._base + len(joints)
        if isinstance(v, np.ndarray) and v.shape == (size,) and v.dtype.kind in "fiu":
            measured = v[self._base :]
            np.copyto(joints, measured, where=np.isfinite(measured))
            # A speed that no joint can have must not ask for full torque.
            np.clip(joints, -self._v_max, self._v_max, out=joints)
        return joints


DEFAULT_STEP = 0.1
"""Largest change of a torque in a tick, by its limit, where the user gives none."""


class RateLimit:
    """Moves along the straight line from the last command to the new one, as far as allowed.

    All joints go the same fraction of the line: torques that hold contacts and limits form a convex
    set at one state, so that what lies between two of them holds too.
    """

    def __init__(self, robot: Robot, bound: Numbers | None) -> None:
        values = np.asarray(DEFAULT_STEP * robot.tau_max if bound is None else bound, dtype=float)
        if values.shape not in ((), (robot.nj,)) or not np.all(values > 0.0):
            raise ConfigurationError(
                "torque_step of the controller is out of range",
                got=bound,
                wanted=f"a number > 0 [N m], or {robot.nj} of them",
            )
        self.bound: Float64[np.ndarray, " nj"] = np.broadcast_to(values, (robot.nj,)).copy()
        self._last: Float64[np.ndarray, " nj"] | None = None

    def limited(self, command: Float64[np.ndarray, " nj"]) -> Float64[np.ndarray, " nj"]:
        """Return the allowed command nearest to the given one."""
        last = self._last
        if last is not None:
            change = command - last
            ratio = float((np.abs(change) / self.bound).max())
            if ratio > 1.0:
                command = last + change / ratio
        self.remember(command)
        return command

    def remember(self, command: Float64[np.ndarray, " nj"]) -> None:
        """Copy the command of a tick."""
        self._last = command.copy()

    def reset(self) -> None:
        """Forget the last command: the next one is unlimited."""
        self._last = None
