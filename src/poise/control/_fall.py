"""`FallWatch`: detection of a robot that lies."""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise._checks import checked_number
from poise._compiled import compiled
from poise.dynamics import Dynamics, Motion, frames_of, motion_of
from poise.errors import ConfigurationError
from poise.robots import Robot

FALL_HEIGHT_RATIO = 0.25
"""Height of the pelvis over the lowest sole, by that at home, below which a robot lies; one that
squats or kneels is higher."""

_PATIENCE = 0.1
"""Time for which the pelvis has to be that low: one wrong measurement is no fall [s]."""


class FallWatch:
    """Fall detection by the height of the pelvis over the lowest sole, on any ground.

    Robots with a fixed base, or without soles, do not fall.
    """

    def __init__(self, robot: Robot, ratio: float | None) -> None:
        frames = [robot.frame_id(name) for name in (robot.pelvis, *robot.soles)]
        table = frames_of(robot.model, frames)
        self._joints, self._offsets = table.joints, table.placements[:, 9:].copy()
        self._watches = robot.floating_base and bool(robot.soles)
        self._ratio = ratio if self._watches else None
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, robot.q_home)
        self._home = self._height(motion_of(robot.model, data))
        self.reset()

    def reset(self) -> None:
        """Assume that the robot stands."""
        self._low_since, self._now = math.nan, self._home

    @property
    def height_ratio(self) -> float | None:
        """The height of the pelvis, by that at home, below which a robot lies; None for never."""
        return self._ratio

    @height_ratio.setter
    def height_ratio(self, ratio: float | None) -> None:
        if ratio is not None:
            ratio = checked_number(ratio, "fall_height_ratio of the controller", above=0.0)
            if ratio >= 1.0 or not self._watches:
                raise ConfigurationError(
                    "fall_height_ratio of the controller is out of range"
                    if self._watches
                    else "a robot that is fixed, or has no soles, does not fall",
                    got=ratio,
                    wanted="a number between 0 and 1, or None" if self._watches else "None",
                )
        self._ratio = ratio

    def sees_fall(self, dynamics: Dynamics) -> bool:
        """Return True once the robot has lain for a while."""
        if self._ratio is None:
            return False
        self._now = self._height(dynamics.motion)
        if self._now > self._ratio * self._home:
            self._low_since = math.nan
            return False
        time = dynamics.state.time
        # A clock that jumped back begins anew.
        if not self._low_since <= time:
            self._low_since = time
        return time - self._low_since >= _PATIENCE

    def describe(self) -> str:
        """Describe the fall."""
        return (
            f"the pelvis is {self._now:.2f} m over the lowest sole, {self._home:.2f} m at home:"
            " the robot has fallen"
        )

    def _height(self, motion: Motion) -> float:
        return _pelvis_over_soles(motion.placements, self._joints, self._offsets)


@compiled
def _pelvis_over_soles(
    placements: Float64[np.ndarray, "joints 12"],
    joints: Int64[np.ndarray, " frames"],
    offsets: Float64[np.ndarray, "frames 3"],
) -> float:
    """Return the height of the first frame over the lowest of the others [m]; 0 without others."""
    pelvis = lowest = 0.0
    for k in range(len(joints)):
        place = placements[joints[k]]
        # The third row of world_R_joint, which stands column by column, and the origin.
        x, y, z = offsets[k]
        height = place[2] * x + place[5] * y + place[8] * z + place[11]
        if k == 0:
            pelvis = lowest = height
        else:
            lowest = height if k == 1 else min(lowest, height)
    return pelvis - lowest
