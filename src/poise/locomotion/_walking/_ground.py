"""`Ground`: how high it is where a foot comes down.

`Placement`: where a sole lies.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float64

from poise._schema import Bounds, Number, Vector, checked
from poise.locomotion._support import Rotation

CLEARANCE = 0.01
"""Least distance of feet from each other and from what a swing passes [m]."""

LEVEL = 1e-3
"""Heights nearer to each other than this are one [m]."""


def yaw_of(rotation: Rotation) -> float:
    """Return the yaw of a rotation, left of the world's x axis, from -pi to pi [rad]."""
    return math.atan2(rotation[1, 0], rotation[0, 0])


def turn_to_left(angle: float) -> Rotation:
    """Rotation about the vertical [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def wrapped(angle: float) -> float:
    """The same angle, from -pi to pi [rad]."""
    return math.remainder(angle, 2.0 * math.pi)


def mean_angle(left: float, right: float) -> float:
    """Half way between two angles, the shorter way round [rad]."""
    return left + 0.5 * wrapped(right - left)


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A floor at one height with platforms on it.

    Attributes:
        height: of the floor in the world [m].
        platforms: what stands on it, each a `Ground.Platform`.
    """

    @checked()
    @dataclass(frozen=True, kw_only=True)
    class Platform:
        """A box on the floor whose top a robot may step on.

        Attributes:
            center: of its footprint in the world [m].
            size: along its x, along its y, and its height [m].
            yaw: its rotation about z [rad].
        """

        center: Annotated[tuple[float, float], Vector(2, Bounds(unit="m"))]
        size: Annotated[tuple[float, float, float], Vector(3, Bounds(positive=True, unit="m"))]
        yaw: Number = 0.0

        def heights(self, points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
            """The platform's height where it is under a point, else zero [m]."""
            local = (points - np.array(self.center)) @ turn_to_left(self.yaw)[:2, :2]
            inside = (np.abs(local) <= 0.5 * np.array(self.size[:2])).all(axis=1)
            return np.where(inside, self.size[2], 0.0)

    height: float = 0.0
    platforms: tuple[Platform, ...] = ()

    def heights(self, points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
        """Height of the ground under each point [m]."""
        rise = np.zeros(len(points))
        for platform in self.platforms:
            rise = np.maximum(rise, platform.heights(points))
        return self.height + rise

    def level_under(self, place: "Placement", size: tuple[float, float]) -> float | None:
        """Height of the ground under a sole of a size [m]; None where an edge is under it."""
        if not self.platforms:
            return self.height
        heights = self.heights(place.grid(*size))
        return float(heights[0]) if float(np.ptp(heights)) < LEVEL else None


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Place of a sole that lies flat on the ground."""

    position: tuple[float, float, float]  # of its centre in the world [m]
    yaw: float  # its heading, seen from above [rad]
    slope: tuple[float, float] = (0.0, 0.0)  # rise of the ground along the world's x and y

    @property
    def rotation(self) -> Rotation:
        """world_R_sole: z is normal to the ground, x has the heading, seen from above."""
        (a, b), c, s = self.slope, math.cos(self.yaw), math.sin(self.yaw)
        z = np.array([-a, -b, 1.0]) / math.sqrt(1.0 + a * a + b * b)
        x = np.array([c, s, a * c + b * s])
        x /= math.sqrt(float(x @ x))
        y = np.array(
            [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]]
        )
        return np.stack((x, y, z), axis=1)

    def grid(self, length: float, width: float) -> Float64[np.ndarray, "n 2"]:
        """Points all over a sole of that size, edges included [m]."""
        x, y = np.meshgrid(np.linspace(-0.5, 0.5, 9) * length, np.linspace(-0.5, 0.5, 3) * width)
        local = np.stack((x.ravel(), y.ravel()), axis=1)
        return np.array(self.position[:2]) + local @ turn_to_left(self.yaw)[:2, :2].T
