"""`Blend` and `Course`: smooth ways from one value to another."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

_SHORTEST = 1e-6
"""A way shorter than this [s] is a step: no control period is, and its rates would overflow."""


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
        if self.done(time):
            return 1.0, 0.0, 0.0
        r = self.phase(time)
        share = r**3 * (10.0 - 15.0 * r + 6.0 * r * r)
        rate = 30.0 * r * r * (1.0 - r) ** 2 / self.duration
        second = 60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / self.duration**2
        return share, rate, second

    def phase(self, time: float) -> float:
        """Share of the duration that is over, zero before the start."""
        return 1.0 if self.done(time) else max(time - self.start, 0.0) / self.duration

    def done(self, time: float) -> bool:
        """Whether the way is behind."""
        return self.duration < _SHORTEST or time >= self.start + self.duration


@dataclass(frozen=True, slots=True)
class Course:
    """A point that goes from a start, with the rates it has there, along a way to rest.

    p(t) = start + way s(t) + T velocity a(r) + T^2 acceleration b(r) with `Blend`'s s and r, its
    duration T, a = r - 6 r^3 + 8 r^4 - 3 r^5 and b = (r^2 - 3 r^3 + 3 r^4 - r^5) / 2: the quintic
    with given position, velocity and acceleration at both ends.

    Attributes:
        blend: when, and for how long.
        start: where it begins [unit].
        way: from there to the goal [unit].
        velocity: rate at the start [unit/s].
        acceleration: second rate at the start [unit/s^2].
    """

    blend: Blend
    start: Float64[np.ndarray, " m"]
    way: Float64[np.ndarray, " m"]
    velocity: Float64[np.ndarray, " m"] | float = field(default=0.0)
    acceleration: Float64[np.ndarray, " m"] | float = field(default=0.0)

    @property
    def goal(self) -> Float64[np.ndarray, " m"]:
        """Where it ends [unit]."""
        return self.start + self.way

    def sample(
        self, time: float
    ) -> tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]]:
        """Position, velocity and acceleration at a time [s]."""
        share, rate, second = self.blend.sample(time)
        position, velocity = self.start + share * self.way, rate * self.way
        acceleration = second * self.way
        if self.blend.done(time):
            return position, velocity, acceleration
        r, T = self.blend.phase(time), self.blend.duration
        v, a = T * self.velocity, T * T * self.acceleration
        position = position + v * (r - 6.0 * r**3 + 8.0 * r**4 - 3.0 * r**5)
        position = position + a * (0.5 * r * r * (1.0 - r) ** 3)
        velocity = velocity + v / T * (1.0 - 18.0 * r * r + 32.0 * r**3 - 15.0 * r**4)
        velocity = velocity + a / T * (r - 4.5 * r * r + 6.0 * r**3 - 2.5 * r**4)
        acceleration = acceleration + v / T**2 * (-36.0 * r + 96.0 * r * r - 60.0 * r**3)
        acceleration = acceleration + a / T**2 * (1.0 - 9.0 * r + 18.0 * r * r - 10.0 * r**3)
        return position, velocity, acceleration
