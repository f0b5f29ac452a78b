"""`TorqueLimit`: bounds of the joint torques."""

import numpy as np
from jaxtyping import Float64

from poise.checks import checked_number
from poise.errors import ConfigurationError
from poise.robots.robot import Robot


class TorqueLimit:
    """|tau| <= scale tau_max, joint by joint.

    Args:
        scale: share of the robot's torque limits that may be used.

    Attributes:
        name: what reports call it.
        lower: lower bounds [N m].
        upper: upper bounds [N m].
    """

    def __init__(self, scale: float = 1.0) -> None:
        self.name = "torque limit"
        self.scale = checked_number(scale, "scale of the torque limit", above=0.0)
        if self.scale > 1.0:
            raise ConfigurationError(
                "scale of the torque limit is above the robot's own limit",
                got=scale,
                wanted="a number in (0, 1]",
            )
        self._robot: Robot | None = None

    def bind(self, robot: Robot) -> None:
        """Takes the limits of a robot; controllers call it before the first tick.

        Raises:
            ConfigurationError: the limit serves another robot.
        """
        if self._robot is not None and self._robot is not robot:
            raise ConfigurationError(
                "the torque limit already serves another robot",
                got=robot.name,
                wanted=f"robot {self._robot.name!r}, or a limit of its own",
            )
        self._robot = robot
        self.upper: Float64[np.ndarray, " nj"] = self.scale * robot.tau_max
        self.lower: Float64[np.ndarray, " nj"] = -self.upper
