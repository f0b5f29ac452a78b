"""`Path`: where a target is at every tick of a recording, and `Loop`, the motion behind it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.dynamics import least_jerk

Point = tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]
"""Position [m], velocity [m/s] and acceleration [m/s^2] of a target in the world."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """A target over the ticks of a recording.

    Attributes:
        position: in the world [m].
        velocity: [m/s].
        acceleration: [m/s^2].
    """

    position: Float64[np.ndarray, "ticks 3"]
    velocity: Float64[np.ndarray, "ticks 3"]
    acceleration: Float64[np.ndarray, "ticks 3"]

    @classmethod
    def of(cls, points: list[Point]) -> "Path":
        """The path through points, one a tick."""
        position, velocity, acceleration = (
            np.array(column) for column in zip(*points, strict=True)
        )
        return cls(position=position, velocity=velocity, acceleration=acceleration)


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """A point that goes round: centre + displacement s(t) + amplitude r(t) sin(2 pi f t + phase).

    Attributes:
        centre: where it is before anything moves [m].
        displacement: of the centre, by a motion of least jerk with the phase s [m].
        shift: when that motion begins, and how long it takes [s].
        amplitude: by axis [m].
        phase: by axis [rad].
        frequency: f [1/s].
        swell: when the amplitude begins to grow, r from zero to one, and how long it takes [s].
    """

    centre: Float64[np.ndarray, "3"]
    displacement: Float64[np.ndarray, "3"]
    shift: tuple[float, float]
    amplitude: Float64[np.ndarray, "3"]
    phase: Float64[np.ndarray, "3"]
    frequency: float
    swell: tuple[float, float]

    def at(self, time: float) -> Point:
        """The point at a time [s]."""
        s, ds, dds = least_jerk(time, *self.shift)
        r, dr, ddr = least_jerk(time, *self.swell)
        w = 2.0 * np.pi * self.frequency
        angle = w * time + self.phase
        sine, cosine = np.sin(angle), np.cos(angle)
        swing, rate = self.amplitude * sine, self.amplitude * w * cosine
        return (
            self.centre + s * self.displacement + r * swing,
            ds * self.displacement + dr * swing + r * rate,
            dds * self.displacement + ddr * swing + 2.0 * dr * rate - r * w * w * swing,
        )
