"""`TorqueStep`: no torque changes by more than a bound from one tick to the next."""

import numpy as np
from jaxtyping import Float64

from poise.checks import Numbers
from poise.errors import ConfigurationError
from poise.robots.robot import Robot

DEFAULT_SHARE = 0.1
"""Largest change of a torque in a tick, as a share of its limit, where the user gives none."""


class TorqueStep:
    """Moves along the straight line from the last torques to the new ones, as far as allowed.

    All joints go the same share of their way: torques that hold contacts and limits form a convex
    set at one state, so that what lies between two of them holds too.

    Args:
        robot: the robot.
        bound: largest change in a tick [N m], one number or one a joint; infinite for none; a tenth
            of the torque limits when None.

    Raises:
        ConfigurationError: a bound that is not positive, or of the wrong length.
    """

    def __init__(self, robot: Robot, bound: Numbers | None) -> None:
        values = np.asarray(DEFAULT_SHARE * robot.tau_max if bound is None else bound, dtype=float)
        if values.shape not in ((), (robot.nj,)) or not np.all(values > 0.0):
            raise ConfigurationError(
                "torque_step of the controller is out of range",
                got=bound,
                wanted=f"a number > 0 [N m], or {robot.nj} of them",
            )
        self.bound: Float64[np.ndarray, " nj"] = np.broadcast_to(values, (robot.nj,)).copy()
        self._last: Float64[np.ndarray, " nj"] | None = None

    def limited(
        self, torque: Float64[np.ndarray, " nj"]
    ) -> tuple[Float64[np.ndarray, " nj"], bool]:
        """The torques of this tick.

        Args:
            torque: what is wanted [N m].

        Returns:
            What is allowed, and whether that is less than wanted.
        """
        last, self._last = self._last, torque
        if last is None:
            return torque, False
        change = torque - last
        ratio = float((np.abs(change) / self.bound).max())
        if ratio <= 1.0:
            return torque, False
        self._last = last + change / ratio
        return self._last, True

    def remember(self, torque: Float64[np.ndarray, " nj"]) -> None:
        """Takes note of torques that went another way [N m]."""
        self._last = torque

    def reset(self) -> None:
        """Forgets the last torques: the next ones are free."""
        self._last = None
