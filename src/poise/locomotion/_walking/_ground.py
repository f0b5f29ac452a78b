"""`Ground`, `Placement` of a sole on it, and the `SwingShape` of a foot over it."""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from jaxtyping import Float64

from poise._schema import Bounds, Number, Vector, checked
from poise.dynamics import least_jerk
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
    """Midpoint of two angles, on the shorter arc [rad]."""
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
    yaw: float  # its heading in the horizontal plane [rad]
    slope: tuple[float, float] = (0.0, 0.0)  # rise of the ground along the world's x and y

    @property
    def rotation(self) -> Rotation:
        """world_R_sole: z is normal to the ground, x has the heading in the horizontal plane."""
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


RISE = 0.45
"""Phase of the swing at which a foot is at its apex; ground that it meets later is ground."""

FIXED = 0.06
"""Goal and time of arrival are fixed when the foot is this near to it [s]."""

Motion = tuple[float, float, float]
"""Position [m], velocity [m/s] and acceleration [m/s^2] along one axis of the world; or angles."""


@dataclass(frozen=True, kw_only=True)
class SwingShape:
    """The shape of one swing, over its phase from 0 at lift-off to 1 at touchdown."""

    apex: float  # highest point of the sole, in the world [m]
    depart: float = 0.0  # phase until which the foot goes straight up
    arrive: float = 0.93  # phase at which it is over its goal; from then on, it comes straight down

    def progress(self, phase: float) -> float:
        """Ratio of the horizontal displacement that is behind at a phase."""
        return least_jerk(phase, self.depart, self.arrive - self.depart)[0]

    def height(self, phase: float, begin: float, end: float) -> Motion:
        """Height of the sole between lift-off and touchdown, and its rates by the phase."""
        apex = max(self.apex, begin, end)
        if phase < RISE:
            low, way, part = begin, apex - begin, least_jerk(phase, 0.0, RISE)
        else:
            low, way, part = apex, end - apex, least_jerk(phase, RISE, 1.0 - RISE)
        return low + part[0] * way, part[1] * way, part[2] * way


_SWINGS = ((0.0, 0.93), (0.1, 0.9), (0.15, 0.85), (0.2, 0.8), (0.25, 0.75), (0.3, 0.7))
"""Departure and arrival of a swing, from the smoothest to the one that clears most."""


def clear_swing(
    begin: Placement, goal: Placement, size: tuple[float, float], height: float, ground: Ground
) -> SwingShape | None:
    """Return the smoothest swing above all platforms under it; None where each one would knock."""
    start, end = begin.position[2], goal.position[2]
    high = max(start, end) + height
    phases = np.linspace(0.0, 1.0, 41).tolist()
    for depart, arrive in _SWINGS:
        shape = SwingShape(apex=high, depart=depart, arrive=arrive)
        under = [_highest(begin, goal, shape.progress(p), size, ground) for p in phases]
        # What lies between may be higher than both ends.
        shape = replace(shape, apex=max(high, max(under) + height))
        if all(
            top <= (start if phase < RISE else end) + LEVEL
            or shape.height(phase, start, end)[0] >= top + CLEARANCE
            for phase, top in zip(phases, under, strict=True)
        ):
            return shape
    return None


def online_swing(
    begin: Placement,
    goal: Placement,
    size: tuple[float, float],
    height: float,
    ground: Ground,
    depth: float,
) -> SwingShape:
    """A swing whose goal may move: above all platforms where there is one, else the smoothest."""
    # A swing that would knock against one is made all the same: it may catch the robot.
    clear = clear_swing(begin, goal, size, height, ground) if ground.platforms else None
    apex = max(begin.position[2], goal.position[2]) + height
    sinking = sinking_phase(depth, apex - goal.position[2])
    return clear or SwingShape(apex=apex, arrive=1.0 - sinking)


def sinking_phase(depth: float, fall: float) -> float:
    """Return the phase in which a foot moves from the ground to its target depth."""
    # At its end a quintic of least jerk is 10 H s^3 above where it ends, s the time left over all.
    if depth <= 0.0:
        return 0.0
    return (1.0 - RISE) * (0.1 * depth / (depth + max(fall, 0.0))) ** (1 / 3)


def _highest(
    begin: Placement, goal: Placement, ratio: float, size: tuple[float, float], ground: Ground
) -> float:
    """The highest ground under a sole between two places, with a margin around it [m]."""
    x, y = (a + ratio * (b - a) for a, b in zip(begin.position[:2], goal.position[:2], strict=True))
    place = Placement(position=(x, y, 0.0), yaw=begin.yaw + ratio * (goal.yaw - begin.yaw))
    grown = (size[0] + 2.0 * CLEARANCE, size[1] + 2.0 * CLEARANCE)
    return float(ground.heights(place.grid(*grown)).max())


def least_jerk_towards(axis: Motion, goal: float, left: float, dt: float) -> Motion:
    """One tick of the least-jerk motion that arrives at rest in the time that is left [s]."""
    x, v, a = axis
    if left <= FIXED:
        # Too short for a new plan: three poles, fast and equal, deal with the last millimetre.
        pole = 3.0 / FIXED
        jerk = pole**3 * (goal - x) - 3.0 * pole**2 * v - 3.0 * pole * a
    else:
        jerk = (60.0 * (goal - x) / left - 36.0 * v) / (left * left) - 9.0 * a / left
    return (
        x + dt * (v + dt * (0.5 * a + dt * jerk / 6.0)),
        v + dt * (a + 0.5 * dt * jerk),
        a + dt * jerk,
    )
