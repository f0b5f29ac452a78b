"""`TrunkLean`: the trunk leans over a foot whose hip is too weak to hold the body upright on it."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.locomotion._stepping._footing import Footing

_RATE = 0.3
"""How fast it leans over a foot, and back [rad/s]."""

_LEVEL = np.eye(3)


class TrunkLean:
    """Upright, or leaning over the foot that carries where its hip needs that.

    Args:
        relief: how far over the left and over the right foot, see `Biped` [rad].
        dt: length of a tick [s].
    """

    def __init__(self, relief: tuple[float, float], dt: float) -> None:
        self._goals = (-relief[0], relief[1])
        self._step = _RATE * dt
        self._angle = 0.0

    def reset(self) -> None:
        """Upright."""
        self._angle = 0.0

    def rotation(self, footing: Footing) -> Float64[np.ndarray, "3 3"]:
        """How the trunk shall be turned in this tick, world_R_trunk.

        Args:
            footing: of the tick.
        """
        carries = footing.mode.support
        goal = 0.0 if carries is None else self._goals[carries]
        self._angle += max(-self._step, min(self._step, goal - self._angle))
        if self._angle == 0.0:
            return _LEVEL
        x, y = footing.heading.tolist()
        return pin.exp3(self._angle * np.array([x, y, 0.0]))
