"""`BodyMomentum`: the angular momentum that the body rotator asks for."""

import numpy as np
from jaxtyping import Float64

from poise.balance import BodyRotator
from poise.teleop.footing import Footing
from poise.teleop.parameters import TeleopParameters
from poise.teleop.rules import Rules


class BodyMomentum:
    """Eqs (39a) and (39b): integrated in single support, with a leak; zero otherwise.

    Args:
        rotator: None where it shall not act.
        parameters: length of a tick and leak.
        rules: departures from the paper.

    Attributes:
        wanted: about the COM, x and y [kg m^2/s].
    """

    def __init__(
        self, rotator: BodyRotator | None, parameters: TeleopParameters, rules: Rules
    ) -> None:
        self._rotator, self._dt = rotator, parameters.dt
        leak = parameters.dt * parameters.momentum_leak
        self._kept = 1.0 - leak if rules.leaking_momentum else 1.0
        self.restart()

    @property
    def acts(self) -> bool:
        """Whether there is a rotator."""
        return self._rotator is not None

    def restart(self) -> None:
        """Another mode has begun."""
        self.wanted: Float64[np.ndarray, "2"] = np.zeros(2)

    def turn(self, footing: Footing, cart_table_zmp: Float64[np.ndarray, "2"]) -> None:
        """One tick.

        Args:
            footing: of the tick.
            cart_table_zmp: CT-ZMP [m].
        """
        if self._rotator is None or not footing.mode.single:
            self.restart()
            return
        rate = self._rotator.momentum_rate(footing.zmp_reference, cart_table_zmp)
        self.wanted = self._kept * self.wanted + self._dt * rate
