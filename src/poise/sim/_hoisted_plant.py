"""`HoistedPlant`: a plant whose robot hangs in a hoist until it stands."""

import math

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.robots import Robot
from poise.sim._config import PlantConfig
from poise.sim._motors import SetPoints
from poise.sim._plant import Plant

RAMP = 3.0
"""Length of each phase of the hoist [s], that of the ramps of a deployment."""

_STRETCH = 0.01
"""Stretch of the rope under the robot's weight [m]: less than the clearance of a swing foot."""

_LIFT = 0.2
"""Height of the soles above the ground by that of the CoM: bent knees that go limp straighten."""


class HoistedPlant(Plant):
    """Plant with a hoist that holds the base where it began.

    The hoist is a spring and a damper at the base, critically damped, that stretches by 1 cm under
    the weight and turns the base back with twice the moment with which gravity tips the robot. At
    first it holds the robot above the ground. `RAMP` after the first stiffness it is lowered
    within `RAMP`; `RAMP` after the first torque it is taken off within `RAMP`.

    Args:
        robot: with a floating base.
        config: of the plant.
        seed: of the sensor noise.
    """

    def __init__(self, robot: Robot, config: PlantConfig | None = None, *, seed: int = 0) -> None:
        self._stiff = self._driven = math.inf
        super().__init__(robot, config, seed=seed)
        weight, height = robot.weight, float(self.com[2])
        push, turn = weight / _STRETCH, 2.0 * weight * height
        # The inertia about the feet is at most m h^2 of the CoM, and as much of the links.
        inertia = 2.0 * robot.mass * height**2
        self._stiffness = np.repeat([push, turn], 3)
        roots = 2.0 * math.sqrt(push * robot.mass), 2.0 * math.sqrt(turn * inertia)
        self._damping = np.repeat(roots, 3)
        self._lift, self._floor = _LIFT * height, float(self.data.qpos[2])
        self._place, self._turn = self.data.qpos[:3].copy(), self.data.qpos[3:7].copy()

    def drive(self, set_points: SetPoints) -> None:
        """Advance one control period under set-points of the drives' own loops.

        Args:
            set_points: as of `Plant.drive`.
        """
        if np.any(set_points.kp):
            self._stiff = min(self._stiff, self.time)
        if np.any(set_points.tau):
            self._driven = min(self._driven, self.time)
        super().drive(set_points)

    def _simulate(self, begin: float) -> None:
        share, up = 1.0 - _passed(begin - self._driven), 1.0 - _passed(begin - self._stiff)
        self._place[2] = self._floor + self._lift * up
        self.data.qfrc_applied[:6] = 0.0 if share == 0.0 else share * self._pull()
        self.model.dof_damping[:6] = share * self._damping  # which MuJoCo integrates implicitly
        super()._simulate(begin)

    def _pull(self) -> Float64[np.ndarray, "6"]:
        """Return force in the world and moment in the base."""
        away = np.zeros(6)
        away[:3] = self.data.qpos[:3] - self._place
        mujoco.mju_subQuat(away[3:], self.data.qpos[3:7], self._turn)
        return -self._stiffness * away


def _passed(since: float) -> float:
    """Part of a ramp that begins one ramp after an event, by the time since that."""
    return min(1.0, max(0.0, since / RAMP - 1.0))
