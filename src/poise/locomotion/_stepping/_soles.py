"""`SoleGrounds`: how the ground lies under each sole, told by the sole and not by a level."""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import rotation_vector
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._parameters import TeleopParameters

_LEVEL = np.eye(3)

_FOLLOW = 5.0
"""How fast the tilt of a ground follows that of a sole which lies flat on it [1/s]."""

_FLAT = (0.1, 0.4)
"""Depth of the centre of pressure in the sole, over half the sole: from the first on the sole
begins to count as flat on the ground, from the second on it is."""

_KNOWN = 0.1
"""How long a sole must have lain flat for its ground to be known [s]."""

_YIELD = 3.0
"""How fast a sole turns whose centre of pressure is at its edge, where the other sole's is in the
middle [1/s], over the sole's half length times ..."""


class SoleGrounds:
    """The tilt of the ground under each foot, as the inertial unit has it.

    A sole whose centre of pressure is well inside lies flat: the ground is tilted as the sole is,
    whatever the unit takes to be level. On its edge it may be rocking, and the ground is what it
    was. Under a foot that has just landed nobody knows the ground until the sole has lain flat: it
    is taken to be as the sole is.

    Args:
        parameters: length of a tick.
    """

    def __init__(self, parameters: TeleopParameters) -> None:
        self._dt = parameters.dt
        self.reset()

    def reset(self) -> None:
        """Nothing is known of the ground."""
        self._tilts = [np.zeros(3), np.zeros(3)]
        self._flat_for = [0.0, 0.0]

    def update(self, footing: Footing) -> None:
        """Takes one tick.

        Args:
            footing: of the tick.
        """
        for foot in (0, 1):
            if footing.mode.single and foot == footing.other:
                self._flat_for[foot] = 0.0
                continue
            flat, tilt = _flatness(footing, foot), self.sole_tilt(footing, foot)
            self._flat_for[foot] += self._dt * flat
            if self._flat_for[foot] < _KNOWN:
                self._tilts[foot] = tilt
            else:
                share = self._dt * _FOLLOW * flat
                self._tilts[foot] = self._tilts[foot] + share * (tilt - self._tilts[foot])

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


def _flatness(footing: Footing, foot: int) -> float:
    """From 0 for a sole that is on its edge or carries nothing to 1 for one that lies flat."""
    centre = footing.sensor.centres[foot]
    if centre is None:
        return 0.0
    length, width = footing.biped.sizes[foot]
    x, y = centre
    depth = min(1.0 - 2.0 * abs(x) / length, 1.0 - 2.0 * abs(y) / width)
    return min(1.0, max(0.0, (depth - _FLAT[0]) / (_FLAT[1] - _FLAT[0])))
