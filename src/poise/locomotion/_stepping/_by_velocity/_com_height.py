"""`ComHeight`: how high the COM shall be, and how fast it goes there."""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise.locomotion._stepping._by_velocity._velocity_numbers import VelocityNumbers
from poise.locomotion._stepping._stance import (
    GIVES,
    POSITION_GAIN,
    Footing,
    FootRange,
    TeleopParameters,
)

_BRAKED = 0.2
"""Part of its largest acceleration with which the COM is braked before a knee is at its limit: by
torques it follows some 0.2 s late. With 0.5 Romeo's knee was at its torque before it stood."""

_LATE = 0.2
"""How late that is where the knee of the leg that carries alone is at its limit [s]: beyond that
nothing brakes."""

_DEEPER = 0.01
"""How far below a foot in the air the body comes down for it where it has felt no floor [m]."""


class ComHeight:
    """Eq. (15b) with (17a); lower where the legs need it, and steady.

    Attributes:
        offset: how much higher than at the start the operator asks for, as far as legs allow [m].
    """

    def __init__(
        self,
        height: float,
        reach: FootRange,
        parameters: TeleopParameters,
        numbers: VelocityNumbers,
    ) -> None:
        self._height, self._range, self._numbers = height, reach, numbers
        self._dt, self._stoop_max = parameters.dt, parameters.stoop_max
        self._velocity = self.offset = 0.0

    def restart(self, velocity: float) -> None:
        """Go on from the vertical velocity of the CoM [m/s]."""
        self._velocity = velocity

    def room(self, footing: Footing) -> tuple[float, bool]:
        """Return how far the CoM may come down [m], and whether the stance leg gives way."""
        stance = footing.stance
        too_weak = self._too_weak(footing, stance, self._range.hip(stance, footing.dynamics))
        below = min(float(footing.dynamics.com[2]) - self._lowest(footing), -too_weak)
        return max(0.0, below), footing.mode.single and too_weak > GIVES

    def velocity(self, footing: Footing, target: Float64[np.ndarray, "3"]) -> float:
        """Velocity of the COM upwards [m/s]."""
        p = self._numbers
        hips = [self._range.hip(foot, footing.dynamics) for foot in (0, 1)]
        too_low = self._too_low(footing, hips)
        way = self._reference(footing, target, hips, too_low) - float(footing.dynamics.com[2])
        # At v_lim downwards the robot would fall faster than its legs can carry; and one that is
        # not braked in time goes on beyond where a knee still holds it.
        braking = _BRAKED * p.lift_acceleration
        braked = math.sqrt(2.0 * braking * max(-too_low, 0.0))
        carries = footing.mode.support
        if carries is not None:
            room = max(-self._too_weak(footing, carries, hips[carries]), 0.0)
            braked = min(braked, braking * (math.sqrt(_LATE**2 + 2.0 * room / braking) - _LATE))
        velocity = max(-min(p.lift_speed, braked), min(p.lift_speed, POSITION_GAIN * way))
        change = self._dt * p.lift_acceleration
        self._velocity = max(self._velocity - change, min(self._velocity + change, velocity))
        return self._velocity

    def _too_weak(self, footing: Footing, foot: int, hip: Float64[np.ndarray, "3"]) -> float:
        return self._range.too_weak(foot, footing.anchors[foot], hip, footing.heading)

    def _too_low(self, footing: Footing, hips: Sequence[Float64[np.ndarray, "3"]]) -> float:
        """How far the hips are too low for what carries; negative for room [m].

        A leg that carries bends no further than its ankle lets the sole stay level.
        """
        carries, heading = footing.mode.support, footing.heading
        feet = (footing.stance,) if footing.mode.single else (0, 1)
        return max(
            self._range.too_low(
                foot, footing.anchors[foot], hips[foot], heading, alone=foot == carries
            )
            for foot in feet
        )

    def _reference(
        self,
        footing: Footing,
        target: Float64[np.ndarray, "3"],
        hips: Sequence[Float64[np.ndarray, "3"]],
        too_low: float,
    ) -> float:
        """Eq. (15b), lower where a leg could not reach its foot, now or at the end [m].

        Not for a target below the floor: there the body would be coming down when the foot lands.
        """
        reach, stance, anchors = self._range, footing.stance, footing.anchors
        x, y, height = footing.dynamics.com.tolist()
        zmp_x, zmp_y = footing.zmp_reference.tolist()
        too_high = -math.inf
        for foot, place in ((stance, anchors[stance]), (footing.other, _felt(footing, target))):
            for shift in ((0.0, 0.0), (zmp_x - x, zmp_y - y)):
                too_high = max(too_high, reach.too_high(foot, place, hips[foot], shift))
        lowest = max(height + too_low, self._lowest(footing))
        usual = self._height + footing.ground
        asked = max(usual + self.offset, min(usual, lowest))
        return min(asked, max(height - too_high, lowest))

    def _lowest(self, footing: Footing) -> float:
        return (1.0 - self._stoop_max) * self._height + footing.ground


def _felt(footing: Footing, target: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
    """A target no lower than the floor; where there is none, no lower than just below the foot."""
    if not footing.mode.single:
        return target
    x, y, z = target.tolist()
    floor = min(footing.lowest_ground, float(footing.sole(footing.other)[2]) - _DEEPER)
    return np.array([x, y, max(z, floor)])
