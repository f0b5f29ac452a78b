"""`SoleTipping`: whether the only sole that carries turns over an edge."""

import numpy as np
from jaxtyping import Float64

from poise.locomotion._stepping._stance._footing import Footing

_TIPPED = 0.1
"""A sole that has turned so far since it began to carry alone stands on an edge [rad].

One on which the robot stands on turns by less than 0.01, whatever the other foot does; those that
tipped went on to 0.13 to 0.4.
"""

_LEAST = float(np.cos(_TIPPED))


class SoleTipping:
    """Compares how the stance sole lies with how it lay when it began to carry alone.

    A sole of which only a part lies on something, such as a bump, may carry its share beside
    another and tip as soon as it carries alone. Robot and divergent component are still above it
    then.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """No sole carries alone."""
        self._stance: int | None = None
        self._up: Float64[np.ndarray, "3"] = np.zeros(3)

    def update(self, footing: Footing) -> bool:
        """Whether the sole that carries alone has tipped.

        Args:
            footing: of the tick.
        """
        if not footing.mode.single:
            self._stance = None
            return False
        stance = footing.stance
        _, rotation = footing.dynamics.placement(footing.biped.frames[stance])
        if stance != self._stance:
            self._stance, self._up = stance, rotation[:, 2]
        return float(self._up @ rotation[:, 2]) < _LEAST
