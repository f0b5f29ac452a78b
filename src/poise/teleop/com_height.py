"""`ComHeight`: how high the COM shall be, and how fast it goes there."""

import numpy as np
from jaxtyping import Float64

from poise.teleop.footing import Footing
from poise.teleop.parameters import TeleopParameters
from poise.teleop.reach import FootRange
from poise.teleop.rules import Rules

_HERE = np.zeros(2)


class ComHeight:
    """Eq. (15b) with (17a); lower where the legs need it, and steady.

    Args:
        height: of the COM above the soles at the start, H [m].
        reach: of the legs.
        parameters: gains and speeds.
        rules: departures from the paper.
    """

    def __init__(
        self, height: float, reach: FootRange, parameters: TeleopParameters, rules: Rules
    ) -> None:
        self._height, self._range = height, reach
        self._parameters, self._rules = parameters, rules
        self._velocity = 0.0

    def room_below(self, footing: Footing) -> float:
        """How far the COM may still come down [m].

        Args:
            footing: of the tick.
        """
        if not self._rules.stooping:
            return 0.0
        return max(0.0, float(footing.dynamics.com[2]) - self._lowest(footing))

    def velocity(self, footing: Footing, target: Float64[np.ndarray, "3"]) -> float:
        """Velocity of the COM upwards [m/s].

        Args:
            footing: of the tick.
            target: where the foot that is not the stance is sent [m].
        """
        p = self._parameters
        wanted = p.k_v * (self._wanted(footing, target) - float(footing.dynamics.com[2]))
        if not self._rules.gentle:
            return max(-p.v_lim, min(p.v_lim, wanted))
        wanted = max(-p.lift_speed, min(p.lift_speed, wanted))
        change = p.dt * p.lift_acceleration
        self._velocity = max(self._velocity - change, min(self._velocity + change, wanted))
        return self._velocity

    def _wanted(self, footing: Footing, target: Float64[np.ndarray, "3"]) -> float:
        """Eq. (15b), lower where a leg could not reach its foot, now or at the end [m]."""
        nominal = self._height + footing.ground
        if not self._rules.stooping:
            return nominal
        com, stance, anchors = footing.dynamics.com, footing.stance, footing.anchors
        hips = [self._range.hip(foot, footing.dynamics) for foot in (0, 1)]
        too_high = max(
            self._range.too_high(foot, place, hips[foot], shift)
            for foot, place in ((stance, anchors[stance]), (footing.other, target))
            for shift in (_HERE, footing.zmp_reference - com[:2])
        )
        # A leg that carries bends no further than its ankle lets the sole stay level.
        too_low = max(
            self._range.too_low(foot, anchors[foot], hips[foot], footing.heading)
            for foot in ((stance,) if footing.mode.single else (0, 1))
        )
        lowest = max(float(com[2]) + too_low, self._lowest(footing))
        return min(nominal, max(float(com[2]) - too_high, lowest))

    def _lowest(self, footing: Footing) -> float:
        return (1.0 - self._parameters.stoop_max) * self._height + footing.ground
