"""`Ground`: how high it is where a foot comes down."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.checks import checked_number
from poise.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class Platform:
    """A box on the floor whose top a robot may step on.

    Attributes:
        center: of its footprint in the world [m].
        size: along its x, along its y, and its height [m].
        yaw: its rotation about z [rad].
    """

    center: tuple[float, float]
    size: tuple[float, float, float]
    yaw: float = 0.0

    def __post_init__(self) -> None:
        for value in self.size:
            checked_number(value, "size of a platform [m]", above=0.0)
        if not all(math.isfinite(value) for value in (*self.center, self.yaw)):
            raise ConfigurationError(
                "place of a platform is not finite",
                got=(*self.center, self.yaw),
                wanted="numbers [m, rad]",
            )

    def heights(self, points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
        """The platform's height where it is under a point, else zero [m]."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        local = (points - np.array(self.center)) @ np.array([[c, -s], [s, c]])
        inside = (np.abs(local) <= 0.5 * np.array(self.size[:2])).all(axis=1)
        return np.where(inside, self.size[2], 0.0)


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A floor at one height with platforms on it.

    Attributes:
        height: of the floor in the world [m].
        platforms: what stands on it.
    """

    height: float = 0.0
    platforms: tuple[Platform, ...] = ()

    def heights(self, points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
        """Height of the ground under each point [m]."""
        rise = np.zeros(len(points))
        for platform in self.platforms:
            rise = np.maximum(rise, platform.heights(points))
        return self.height + rise
