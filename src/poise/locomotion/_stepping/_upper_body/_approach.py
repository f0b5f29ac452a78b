"""`Approach`: velocities towards a goal."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

_BRAKING = 0.6
"""Part of the largest acceleration that is counted on near a goal."""


@dataclass(frozen=True, kw_only=True)
class Approach:
    """Bounds of a motion towards a goal: speed over distance [1/s], speed and acceleration."""

    gain: float
    speed: float
    acceleration: float

    def velocity(
        self, way: Float64[np.ndarray, " n"], rate: Float64[np.ndarray, " n"] | None = None
    ) -> Float64[np.ndarray, " n"]:
        """Return the velocity over a way to a goal that moves at a rate: it can be braked."""
        far = math.hypot(*way)
        braked = math.sqrt(2.0 * _BRAKING * self.acceleration * far)
        velocity = way * (min(self.gain * far, braked, self.speed) / max(far, 1e-9))
        if rate is None:
            return velocity
        velocity += rate
        return velocity * min(1.0, self.speed / max(math.hypot(*velocity), 1e-9))

    def step(
        self, wanted: Float64[np.ndarray, " n"], now: Float64[np.ndarray, " n"], dt: float
    ) -> Float64[np.ndarray, " n"]:
        """Return the velocity after a tick on the way from one velocity to another."""
        change = wanted - now
        return now + change * min(1.0, self.acceleration * dt / max(math.hypot(*change), 1e-12))
