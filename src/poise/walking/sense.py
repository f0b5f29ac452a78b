"""`WalkSense`: what a walker needs to know of the robot's state."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics.state import RobotState
from poise.robots.robot import Robot


class WalkSense:
    """Centre of mass and soles of a state; a fifth of what a controller computes.

    Args:
        robot: the robot.
        soles: names of its soles.

    Attributes:
        com: centre of mass [m].
        com_velocity: its velocity [m/s].
    """

    def __init__(self, robot: Robot, soles: tuple[str, str]) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._ids = [robot.frame_id(name) for name in soles]
        self.com: Float64[np.ndarray, "3"] = self._data.com[0]
        self.com_velocity: Float64[np.ndarray, "3"] = self._data.vcom[0]

    def update(self, state: RobotState) -> None:
        """Takes a state in."""
        pin.centerOfMass(self._model, self._data, state.q, state.v, False)

    def sole(self, foot: int) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]:
        """Position [m] and rotation of a sole in the world."""
        placement = pin.updateFramePlacement(self._model, self._data, self._ids[foot])
        return placement.translation, placement.rotation
