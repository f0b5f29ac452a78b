"""`Gravity`: vertical gravity, constant or swept over time."""

from dataclasses import dataclass
from math import isfinite

from poise.errors import ConfigurationError
from poise.robots import GRAVITY

EARTH = -GRAVITY
"""Vertical gravity on Earth, as robots' models have it [m/s^2]."""


@dataclass(frozen=True, kw_only=True)
class Gravity:
    """Vertical gravity that goes from one value to another at a constant rate, then stays.

    Attributes:
        first: at time zero; negative is downwards [m/s^2].
        last: at the end of the sweep; `first` when None, which is constant gravity [m/s^2].
        duration: length of the sweep [s].
    """

    first: float = EARTH
    last: float | None = None
    duration: float = 1.0

    def __post_init__(self) -> None:
        values = (self.first, self.first if self.last is None else self.last)
        if not all(isfinite(value) for value in values):
            raise ConfigurationError(
                "gravity is not finite", got=values, wanted="finite numbers [m/s^2]"
            )
        if not (isfinite(self.duration) and self.duration > 0.0):
            raise ConfigurationError(
                "the sweep of gravity has no length", got=self.duration, wanted="seconds > 0"
            )

    @property
    def constant(self) -> bool:
        """Whether it never changes."""
        return self.last is None or self.last == self.first

    def at(self, time: float) -> float:
        """Vertical gravity at a time [s]."""
        if self.last is None:
            return self.first
        share = min(max(time / self.duration, 0.0), 1.0)
        return self.first + share * (self.last - self.first)
