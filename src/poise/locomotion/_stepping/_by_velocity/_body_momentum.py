"""`BodyMomentum`: the angular momentum that the body rotator asks for."""

import numpy as np
from jaxtyping import Float64

from poise.locomotion._pendulum import BodyRotator
from poise.locomotion._stepping._stance import Footing


class BodyMomentum:
    """Eqs (39a) and (39b): integrated in single support, with a leak; zero otherwise.

    Attributes:
        reference: about the COM, x and y [kg m^2/s].
    """

    def __init__(self, rotator: BodyRotator | None, dt: float, leak: float) -> None:
        self._rotator, self._dt = rotator, dt
        # A pure integral drives the torso in a limit cycle.
        self._kept = 1.0 - dt * leak
        self.restart()

    def restart(self) -> None:
        """Another mode has begun."""
        self.reference: Float64[np.ndarray, "2"] = np.zeros(2)

    def turn(self, footing: Footing, cart_table_zmp: Float64[np.ndarray, "2"]) -> None:
        """One tick."""
        if self._rotator is None or not footing.mode.single:
            self.restart()
            return
        rate = self._rotator.momentum_rate(footing.zmp_reference, cart_table_zmp)
        self.reference = self._kept * self.reference + self._dt * rate
