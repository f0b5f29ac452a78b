"""`FootVelocity`: how fast the foot goes that is not the stance."""

import numpy as np
from jaxtyping import Float64

from poise.balance import saturate
from poise.teleop.footing import Footing
from poise.teleop.parameters import TeleopParameters
from poise.teleop.rules import Rules

_CALM = 0.8
"""Share of the deepest place in the sole from which on the swing foot has all its speed."""


class FootVelocity:
    """Eq. (17c), gently down and smoothed.

    Args:
        parameters: gains, speeds and times.
        rules: departures from the paper.
    """

    def __init__(self, parameters: TeleopParameters, rules: Rules) -> None:
        self._parameters, self._rules = parameters, rules
        self._share = parameters.dt / (parameters.swing_time + parameters.dt)
        self.restart()

    def restart(self) -> None:
        """Another mode has begun."""
        self._smoothed: Float64[np.ndarray, "3"] = np.zeros(3)

    def towards(
        self, footing: Footing, target: Float64[np.ndarray, "3"], *, hurry: bool
    ) -> Float64[np.ndarray, "3"]:
        """The velocity [m/s].

        Args:
            footing: of the tick.
            target: where the foot is sent [m].
            hurry: whether it has to be down as soon as it can.
        """
        p = self._parameters
        wanted = saturate(p.v_lim, p.k_v * (target - footing.sole(footing.other)))
        if self._rules.gentle and not hurry:
            wanted[2] = max(float(wanted[2]), -self._lowering_speed(footing))
        if not (self._rules.smooth_swing and footing.mode.single):
            return wanted
        wanted[:2] *= _calm(footing)
        self._smoothed = self._smoothed + self._share * (wanted - self._smoothed)
        return self._smoothed

    def _lowering_speed(self, footing: Footing) -> float:
        """How fast the foot may come down: slowly where the ground may be [m/s]."""
        p = self._parameters
        clear = footing.clearance(footing.highest_ground, p.clear_height)
        return p.touch_speed + clear * (p.lower_speed - p.touch_speed)


def _calm(footing: Footing) -> float:
    """Share of its speed that the swing foot may have: less the nearer the robot is to tipping.

    Swinging a leg takes angular momentum, which is then missing for the balance.
    """
    x, y = footing.anchors[footing.stance][:2].tolist()
    most = footing.support.depth((x, y))
    if most <= 0.0:
        # A sole tilted so far that no ground is left under it.
        return 0.0
    return min(1.0, max(0.0, footing.capture_depth / (_CALM * most)))
