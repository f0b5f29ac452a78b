"""`Path`: where a target is at every tick of a recording, and `Loop`, the motion behind it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.apps.scenarios._director import Blend

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
    """A point that goes round: centre + way s(t) + amplitude r(t) sin(2 pi f t + phase).

    Attributes:
        centre: where it is before anything moves [m].
        way: a shift that `shift` blends in [m].
        shift: s, from zero to one.
        amplitude: by axis [m].
        phase: by axis [rad].
        frequency: f [1/s].
        swell: r, from zero to one, so that the motion starts softly.
    """

    centre: Float64[np.ndarray, "3"]
    way: Float64[np.ndarray, "3"]
    shift: Blend
    amplitude: Float64[np.ndarray, "3"]
    phase: Float64[np.ndarray, "3"]
    frequency: float
    swell: Blend

    def at(self, time: float) -> Point:
        """The point at a time [s]."""
        s, ds, dds = self.shift.sample(time)
        r, dr, ddr = self.swell.sample(time)
        w = 2.0 * np.pi * self.frequency
        angle = w * time + self.phase
        sine, cosine = np.sin(angle), np.cos(angle)
        swing, rate = self.amplitude * sine, self.amplitude * w * cosine
        return (
            self.centre + s * self.way + r * swing,
            ds * self.way + dr * swing + r * rate,
            dds * self.way + ddr * swing + 2.0 * dr * rate - r * w * w * swing,
        )
