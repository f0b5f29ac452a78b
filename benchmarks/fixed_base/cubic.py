"""`Cubic`: the paper's smooth way from one value to another."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Cubic:
    """A cubic polynomial from rest to rest, x(r) = way (3 r^2 - 2 r^3) with r = t / duration.

    Its acceleration jumps at both ends.

    Attributes:
        way: how far [unit].
        duration: how long [s].
    """

    way: float
    duration: float

    def at(self, time: float) -> tuple[float, float, float]:
        """Value, rate [unit/s] and second rate [unit/s^2] at a time [s]; still after the end."""
        if time >= self.duration:
            return self.way, 0.0, 0.0
        r, T = time / self.duration, self.duration
        return (
            self.way * r * r * (3.0 - 2.0 * r),
            6.0 * self.way * r * (1.0 - r) / T,
            6.0 * self.way * (1.0 - 2.0 * r) / T**2,
        )
