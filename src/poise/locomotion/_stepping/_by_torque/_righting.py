"""`SoleRighting`: soles that stand, carry little and are far off level are turned back."""

import math

from poise.locomotion._stepping._stance import Footing
from poise.stack import SurfaceContact

_STIFFNESS, _MOST = 400.0, 60.0
"""How hard a sole is turned back [1/s^2], and the largest angular acceleration of that
[rad/s^2]."""

GROUND = 0.1
"""Sine of how far a sole may be off level, and lie as the ground does, as far as anyone knows: a
slope of 3 degrees with an attitude off by 1, or a bump."""

_LIGHT, _FIRM = 0.1, 0.2
"""Parts of the weight: a sole that carries less than the first is turned, one that carries more
than the second lies as the ground does."""


class SoleRighting:
    """Turn soles that have just landed, or have lost their load, as if they were in the air."""

    def __init__(self, contacts: list[SurfaceContact], weight: float) -> None:
        self._contacts, self._weight = contacts, weight
        self._turning = [False, False]

    def reset(self) -> None:
        """No sole is turned."""
        for foot in (0, 1):
            self._turn(foot, 0.0, 0.0)

    def update(self, footing: Footing) -> None:
        """One tick."""
        for foot, load in enumerate(footing.sense.loads.tolist()):
            share = min(max((_FIRM - load / self._weight) / (_FIRM - _LIGHT), 0.0), 1.0)
            if share == 0.0 or not self._contacts[foot].active:
                if self._turning[foot]:
                    self._turn(foot, 0.0, 0.0)
                continue
            # The sine of the angle to the vertical, about the sole's own axes.
            up_x, up_y, _ = footing.soles[foot][1][2].tolist()
            off = math.hypot(up_x, up_y)
            beyond = share * _STIFFNESS * max(0.0, 1.0 - GROUND / max(off, GROUND))
            most = share * _MOST
            x, y = -beyond * up_y, beyond * up_x
            self._turn(foot, max(-most, min(most, x)), max(-most, min(most, y)))

    def _turn(self, foot: int, x: float, y: float) -> None:
        turns = x != 0.0 or y != 0.0
        if turns or self._turning[foot]:
            self._contacts[foot].set_acceleration((0.0, 0.0, 0.0, x, y, 0.0))
            self._turning[foot] = turns
