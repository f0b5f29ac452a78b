"""`least_jerk`: motion from zero to one, from rest to rest. `Quintic`: from any rates to rest.

Both are the minimum-jerk polynomial of Flash and Hogan (1985, "The coordination of arm movements"):
the polynomial of fifth order with given position, velocity and acceleration at both ends.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

_SHORTEST = 1e-6
"""Motions shorter than this [s] are steps: control periods are longer, and rates would overflow."""

_TO_REST = np.array(
    [[1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [-6.0, -1.5, 10.0], [8.0, 1.5, -15.0], [-3.0, -0.5, 6.0]]
)
"""Coefficients of r, r^2 ... r^5 from T v_0, T^2 a_0 and the displacement, with rest at r = 1."""


def least_jerk(time: float, start: float, duration: float) -> tuple[float, float, float]:
    """Evaluate the phase of a motion from rest to rest, and its rates.

    s(t) = 10 r^3 - 15 r^4 + 6 r^5 with r = (t - start) / duration; zero before, one after.

    Args:
        time: t [s].
        start: time of the start [s].
        duration: of the motion [s]; zero for a step.

    Returns:
        s, its rate [1/s] and its second rate [1/s^2].
    """
    if _is_over(time, start, duration):
        return 1.0, 0.0, 0.0
    if time <= start:
        return 0.0, 0.0, 0.0
    r = (time - start) / duration
    rest = 1.0 - r
    return (
        r * r * r * (10.0 + r * (6.0 * r - 15.0)),
        30.0 * r * r * rest * rest / duration,
        60.0 * r * rest * (1.0 - 2.0 * r) / (duration * duration),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Quintic:
    """A motion from a position and its rates to rest at a goal.

    Attributes:
        start: time of the start [s].
        duration: T [s]; zero for a step.
        position: at the start [unit].
        goal: position at the end [unit].
        velocity: v_0, at the start [unit/s].
        acceleration: a_0, at the start [unit/s^2].
    """

    start: float
    duration: float
    position: Float64[np.ndarray, " m"]
    goal: Float64[np.ndarray, " m"]
    velocity: Float64[np.ndarray, " m"] | float = 0.0
    acceleration: Float64[np.ndarray, " m"] | float = 0.0

    def is_over(self, time: float) -> bool:
        """Return True once the goal is reached at a time [s]."""
        return _is_over(time, self.start, self.duration)

    def sample(
        self, time: float
    ) -> tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]]:
        """Return position, velocity and acceleration at a time [s]."""
        rest = np.zeros_like(self.goal)
        if self.is_over(time):
            return self.goal.copy(), rest, rest
        T = self.duration
        r = max(time - self.start, 0.0) / T
        ends = np.array(
            [rest + T * self.velocity, rest + T * T * self.acceleration, self.goal - self.position]
        )
        powers = np.array(
            [
                [r, r**2, r**3, r**4, r**5],
                [1.0, 2.0 * r, 3.0 * r**2, 4.0 * r**3, 5.0 * r**4],
                [0.0, 2.0, 6.0 * r, 12.0 * r**2, 20.0 * r**3],
            ]
        )
        displacement, velocity, acceleration = powers @ (_TO_REST @ ends)
        return self.position + displacement, velocity / T, acceleration / (T * T)


def _is_over(time: float, start: float, duration: float) -> bool:
    return time - start >= (duration if duration >= _SHORTEST else 0.0)
