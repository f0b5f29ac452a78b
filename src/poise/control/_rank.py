"""`RankTreatment`: fading of directions that a task loses."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class RankTreatment:
    """Fading of directions along which the robot loses mobility.

    A task's prioritised Jacobian in the mass metric, `J_i|p M^-1/2`, has singular values. Each is
    measured against the mobility that the task's rows have by themselves in the robot's home
    posture, a pure number: about one where a task moves freely, and zero where a singularity or the
    tasks above have taken the direction. The activation

        a(s) = 3 t^2 - 2 t^3   with t = (s - low) / (high - low), kept between 0 and 1

    multiplies the inverse along that direction, a / s^2 in place of 1 / s^2, and the same fraction
    of the direction is withheld from the tasks below. Torques are continuous in the state and
    bounded, and levels above are not affected.

    Attributes:
        low: singular value up to which a direction is left alone.
        high: singular value from which a direction is controlled exactly.
    """

    low: float = 0.02
    high: float = 0.1

    def __post_init__(self) -> None:
        checked_number(self.low, "low threshold of the rank treatment", above=0.0)
        checked_number(self.high, "high threshold of the rank treatment", above=0.0)
        if not self.low < self.high <= 1.0:
            raise ConfigurationError(
                "thresholds of the rank treatment do not grow",
                got=(self.low, self.high),
                wanted="low < high, at most 1",
            )

    def activate(
        self, squares: Float64[np.ndarray, " m"]
    ) -> tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]]:
        """Return activations of directions and their inverses.

        Args:
            squares: squared singular values s^2; rounding may have left them slightly negative.

        Returns:
            a(s), and a(s) / s^2.
        """
        singular = np.sqrt(np.maximum(squares, 0.0))
        t = np.clip((singular - self.low) / (self.high - self.low), 0.0, 1.0)
        activation = t * t * (3.0 - 2.0 * t)
        return activation, activation / np.maximum(squares, self.low * self.low)

    def damp(self, square: float) -> float:
        """Return the least softening low sqrt(1 - s^2 / high^2), or zero, for the least s^2."""
        return self.low * sqrt(max(1.0 - square / self.high**2, 0.0))


def block_scales(
    sizes: Float64[np.ndarray, " m"], blocks: Sequence[int]
) -> Float64[np.ndarray, " m"]:
    """Return one over the largest size of each block of rows; one where nothing moves a block."""
    scale = np.ones(len(sizes))
    for start, stop in pairwise(accumulate(blocks, initial=0)):
        largest = float(sizes[start:stop].max())
        if largest > 0.0:
            scale[start:stop] = 1.0 / largest
    return scale


PHYSICS_RANK = RankTreatment(low=1e-5, high=1e-4)
"""For contacts and the base, whose rows are never damped: only redundant rows are dropped."""
