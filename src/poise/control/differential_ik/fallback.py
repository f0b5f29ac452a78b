"""`VelocityFallback`: safe joint velocities for the ticks that have no answer."""

import numpy as np
from jaxtyping import Float64

from poise.control.fading import Fading
from poise.robots.robot import Robot

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
