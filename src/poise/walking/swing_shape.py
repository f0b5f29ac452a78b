"""`SwingShape`: how high a foot is, and how far on its way, through a swing."""

import math
from dataclasses import dataclass

from poise.checks import checked_number
from poise.errors import ConfigurationError

RISE = 0.45
"""Share of the swing in which a foot goes up."""


@dataclass(frozen=True, kw_only=True)
class SwingShape:
    """The shape of one swing, over shares of its duration.

    Attributes:
        apex: highest point of the sole, in the world [m].
        depart: when the foot leaves its place sideways; before, it goes straight up.
        arrive: when it is over its goal; from then on, it comes straight down.
    """

    apex: float
    depart: float = 0.0
    arrive: float = 0.93

    def __post_init__(self) -> None:
        if not math.isfinite(self.apex):
            raise ConfigurationError(
                "apex of a swing is not finite", got=self.apex, wanted="a height [m]"
            )
        checked_number(self.depart, "departure of a swing")
        if not self.depart < self.arrive <= 1.0:
            raise ConfigurationError(
                "a swing arrives before it departs, or after its end",
                got=(self.depart, self.arrive),
                wanted="0 <= depart < arrive <= 1",
            )

    def progress(self, share: float) -> float:
        """How much of the horizontal way is behind."""
        return least_jerk(share - self.depart, self.arrive - self.depart)[0]

    def height(self, share: float, begin: float, end: float) -> float:
        """Height of the sole on its way from one height to another [m]."""
        apex = max(self.apex, begin, end)
        if share < RISE:
            return begin + least_jerk(share, RISE)[0] * (apex - begin)
        return apex + least_jerk(share - RISE, 1.0 - RISE)[0] * (end - apex)


def least_jerk(time: float, duration: float) -> tuple[float, float, float]:
    """Share of a way from rest to rest, and its rates (Flash and Hogan 1985)."""
    r = time / duration
    if r <= 0.0:
        return 0.0, 0.0, 0.0
    if r >= 1.0:
        return 1.0, 0.0, 0.0
    return (
        r * r * r * (10.0 + r * (6.0 * r - 15.0)),
        30.0 * r * r * (1.0 - r) * (1.0 - r) / duration,
        60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / (duration * duration),
    )
