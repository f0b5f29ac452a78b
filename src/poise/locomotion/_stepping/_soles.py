"""`SoleGrounds`: how the ground lies under each sole, told by the sole and not by a level."""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import rotation_vector
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._parameters import TeleopParameters

_LEVEL = np.eye(3)

_FOLLOW, _CORRECT = 5.0, 20.0
"""How fast the tilt of a ground follows that of a sole which lies flat on it, and how fast it is
put right by a sole that cannot be turned as it is [1/s]."""

_FLAT = (0.1, 0.4)
"""Depth of the centre of pressure in the sole, over half the sole: up to the first the sole may be
on its edge, from the second on it lies flat."""


_SEEK = 0.5
import os
FORGET = bool(os.environ.get('FORGET'))


class SoleGrounds:
    """The tilt of the ground under each foot, as the inertial unit has it.

    A sole whose centre of pressure is well inside lies flat: the ground is tilted as the sole is,
    whatever the unit takes to be level. With the centre of pressure at the toes the sole's heel
    may be off the ground, but nothing of it is below: the ground falls off forward no more than
    the sole does. Likewise at the heel and at either side.

    Args:
        parameters: length of a tick.
    """

    def __init__(self, parameters: TeleopParameters) -> None:
        self._follow, self._correct = parameters.dt * _FOLLOW, parameters.dt * _CORRECT
        self.reset()

    def reset(self) -> None:
        """Level, for all that is known."""
        self._tilts = [np.zeros(3), np.zeros(3)]
        self._known = [[False, False], [False, False]]

    def update(self, footing: Footing) -> None:
        """Takes one tick.

        Args:
            footing: of the tick.
        """
        for foot in (0, 1):
            centre = footing.sensor.centres[foot]
            if footing.mode.single and foot == footing.other:
                # It will land on what the other stands on, for all that is known.
                self._tilts[foot] = self._tilts[1 - foot].copy()
                if FORGET:
                    self._known[foot] = [False, False]
            elif centre is not None:
                length, width = footing.biped.sizes[foot]
                off = self.sole_tilt(footing, foot) - self._tilts[foot]
                parts = -2.0 * centre[1] / width, 2.0 * centre[0] / length
                for axis, part in enumerate(parts):
                    if not self._known[foot][axis]:
                        self._tilts[foot][axis] += off[axis]
                        self._known[foot][axis] = abs(part) < 1.0 - _FLAT[0]
                    else:
                        self._tilts[foot][axis] += self._believed(float(off[axis]), part)

    def _believed(self, off: float, centre: float) -> float:
        """How much of a difference of tilts about an axis is the ground's [rad].

        Args:
            off: sole less ground [rad].
            centre: of pressure, over half the sole, on the side that such a tilt lowers.
        """
        flat = min(1.0, max(0.0, (1.0 - abs(centre) - _FLAT[0]) / (_FLAT[1] - _FLAT[0])))
        # On the lowered edge the sole may be tilted; with the other one down it cannot be.
        wrong = 1.0 - flat if off * centre < 0.0 else 0.0
        return (self._follow * flat + self._correct * wrong) * off

    def seek(self, footing: Footing, foot: int) -> Float64[np.ndarray, "3"]:
        """How fast a sole turns that stands on an edge and has not lain flat yet [rad/s]."""
        centre = footing.sensor.centres[foot]
        if centre is None:
            return np.zeros(3)
        x, y = centre
        about_x, about_y = self._known[foot]
        rate_x = 0.0 if about_x else math.copysign(_SEEK, y)
        rate_y = 0.0 if about_y else -math.copysign(_SEEK, x)
        return np.array([rate_x, rate_y, 0.0])

    def lift(self, footing: Footing) -> Float64[np.ndarray, "3"]:
        """How far the stance sole is turned from its ground, horizontal axis times angle [rad]."""
        return self.sole_tilt(footing, footing.stance) - self._tilts[footing.stance]

    def rotation(self, foot: int) -> Float64[np.ndarray, "3 3"]:
        """How the ground under a foot is turned, world_R_ground."""
        return pin.exp3(self._tilts[foot])

    @staticmethod
    def sole_tilt(footing: Footing, foot: int) -> Float64[np.ndarray, "3"]:
        """How a sole is turned from level, horizontal axis times angle [rad]."""
        _, rotation = footing.dynamics.placement(footing.biped.frames[foot])
        tilt = rotation_vector(rotation, _LEVEL)
        tilt[2] = 0.0
        return tilt

