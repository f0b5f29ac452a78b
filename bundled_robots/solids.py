"""Primitive solids that robots made in code are built from, with exact masses and inertias."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Literal

import numpy as np
import pinocchio as pin

_PARALLEL = 1e-9
"""Directions closer than this to the z axis need no rotation."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """One solid of uniform density, fixed to a link."""

    kind: Literal["box", "cylinder", "sphere"]  # which solid
    # box: edge lengths; cylinder: radius and length along its z; sphere: radius [m]
    size: tuple[float, ...]
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)  # centre in the link [m]
    # Orientation in the link as URDF's roll, pitch, yaw [rad]
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: str = "shell"  # name of a colour in the palette
    solid: bool = False  # whether it also collides

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        if self.kind == "box":
            return math.prod(self.size)
        if self.kind == "cylinder":
            return math.pi * self.size[0] ** 2 * self.size[1]
        return 4.0 / 3.0 * math.pi * self.size[0] ** 3

    def inertia(self, mass: float) -> pin.Inertia:
        """Inertia of the solid in the link's frame."""
        makers = {
            "box": pin.Inertia.FromBox,
            "cylinder": pin.Inertia.FromCylinder,
            "sphere": pin.Inertia.FromSphere,
        }
        link_T_shape = pin.SE3(pin.rpy.rpyToMatrix(*self.rpy), np.array(self.position))
        return link_T_shape.act(makers[self.kind](mass, *self.size))


def combined_inertia(shapes: Sequence[Shape], mass: float) -> pin.Inertia:
    """Inertia of solids of one density that weigh `mass` [kg]; an overlap counts twice."""
    volume = sum(shape.volume for shape in shapes)
    return reduce(add, (shape.inertia(mass * shape.volume / volume) for shape in shapes))


def box(
    size: tuple[float, float, float],
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0),
    colour: str = "shell",
    solid: bool = False,
) -> Shape:
    """A box of the given edge lengths [m] around `at` [m]."""
    return Shape(kind="box", size=size, position=at, rpy=rpy, colour=colour, solid=solid)


def sphere(
    radius: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0), *, colour: str = "shell"
) -> Shape:
    """A sphere of the given radius [m] around `at` [m]."""
    return Shape(kind="sphere", size=(radius,), position=at, colour=colour)


def rod(
    start: Sequence[float], end: Sequence[float], radius: float, *, colour: str = "shell"
) -> Shape:
    """A cylinder of the given radius [m] between two points [m]."""
    a, b = np.array(start, dtype=np.float64), np.array(end, dtype=np.float64)
    length = float(np.linalg.norm(b - a))
    x, y, z = (b - a) / length
    # Tilt z by `pitch` about y, then turn about z: URDF's order of angles.
    pitch = math.acos(max(-1.0, min(1.0, float(z))))
    yaw = math.atan2(y, x) if math.hypot(x, y) > _PARALLEL else 0.0
    centre = (a + b) / 2.0
    return Shape(
        kind="cylinder",
        size=(radius, length),
        position=(float(centre[0]), float(centre[1]), float(centre[2])),
        rpy=(0.0, pitch, yaw),
        colour=colour,
    )


def capsule(
    start: Sequence[float], end: Sequence[float], radius: float, *, colour: str = "shell"
) -> tuple[Shape, ...]:
    """A cylinder between two points with a ball at each end [m]."""
    a, b = ((float(p[0]), float(p[1]), float(p[2])) for p in (start, end))
    return (
        rod(a, b, radius, colour=colour),
        sphere(radius, a, colour=colour),
        sphere(radius, b, colour=colour),
    )


def drum(
    axis: Literal["x", "y", "z"],
    radius: float,
    length: float,
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    colour: str = "joint",
) -> Shape:
    """A cylinder around a joint axis of the link, as the housing of a motor looks [m]."""
    half = np.zeros(3)
    half["xyz".index(axis)] = length / 2.0
    centre = np.array(at)
    return rod(list(centre - half), list(centre + half), radius, colour=colour)


def slab(
    size: tuple[float, float, float],
    at: tuple[float, float, float],
    radius: float,
    *,
    colour: str = "shell",
) -> tuple[Shape, ...]:
    """A box whose four upright edges are rounded: two crossed boxes and four upright rods [m]."""
    x, y, z = size
    rods = tuple(
        drum(
            "z",
            radius,
            z,
            (at[0] + sx * (x / 2 - radius), at[1] + sy * (y / 2 - radius), at[2]),
            colour=colour,
        )
        for sx in (1.0, -1.0)
        for sy in (1.0, -1.0)
    )
    return (
        box((x - 2 * radius, y, z), at, colour=colour),
        box((x, y - 2 * radius, z), at, colour=colour),
        *rods,
    )
