"""`Blend`: a smooth way from one value to another."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Blend:
    """A quintic from zero to one: position, velocity and acceleration are continuous.

    s(t) = 10 r^3 - 15 r^4 + 6 r^5 with r = (t - start) / duration in [0, 1]; the minimum-jerk
    motion of Flash and Hogan (1985).

    Attributes:
        start: when it begins [s].
        duration: how long it takes [s]; zero for a step.
    """

    start: float
    duration: float

    def sample(self, time: float) -> tuple[float, float, float]:
        """Share of the way, its rate [1/s] and its second rate [1/s^2] at a time [s]."""
        if self.duration <= 0.0 or time >= self.start + self.duration:
            return 1.0, 0.0, 0.0
        r = max(time - self.start, 0.0) / self.duration
        share = r**3 * (10.0 - 15.0 * r + 6.0 * r * r)
        rate = 30.0 * r * r * (1.0 - r) ** 2 / self.duration
        second = 60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / self.duration**2
        return share, rate, second

    def done(self, time: float) -> bool:
        """Whether the way is behind."""
        return time >= self.start + self.duration
