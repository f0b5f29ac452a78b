"""`SingleSupportRegion`: rest of the ZMP on one foot, and the DCM that the foot holds there."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from poise.locomotion._support import Point, SolePart, SupportPolygon, one_sole
from poise.robots import Robot

_PUSH, _INWARDS_MAX = 0.2, 0.65
"""Outward push that one foot is to hold [m/s], and how far beside the middle of the sole the ZMP
may rest for that, over half its width."""

_STRAY = 0.013
"""Deviation of the DCM from its reference on bumps, with attitude error and sensor noise [m]."""

_OUTER, _ASKED = 0.0275, 0.0525
"""Distance beyond a narrow sole's outer edge up to which angular momentum holds the DCM, and the
distance beyond it of the CT-ZMP commanded then [m]."""

_MOMENTUM = 0.01
"""The latter for any other sole [m]."""

_INNER_MARGIN = 0.006
"""Distance of the CT-ZMP from a narrow sole's inner edge: contacts keep the pressure some
millimetres from it, and what is asked beyond leans the trunk [m]."""

_ARRIVING = 0.6
"""Part of the inward rest for which a weight shift aims; the rest brakes what the swing adds."""

_ANNOUNCED = 0.7
"""Inward shift of the stance sole that the balance limit takes as a foothold, over the inward rest
of the ZMP."""

Vector3 = Float64[np.ndarray, "3"]
Rotation = Float64[np.ndarray, "3 3"]


@dataclass(frozen=True, kw_only=True)
class SingleSupportRegion:
    """Rest of the ZMP and limits of DCM and CT-ZMP while one foot carries the robot.

    Pushed inwards, the swing foot is put down and holds the robot; pushed outwards it would have to
    cross the stance leg. So where a push outwards takes more than half of a sole the ZMP rests on
    its inner side. On one that is too narrow even for that, angular momentum of trunk, arms and
    swing leg makes up for the rest, on its outer side.

    Attributes:
        sizes: length and width of the left and of the right sole [m].
        margin: distance from the soles' edges at which support ends [m].
        inwards: distance of the ZMP's rest from the middle of the sole, towards the other foot [m].
        inner: distance beyond the inner edge of support at which the robot steps [m].
        outer: distance beyond the outer edge at which it does [m].
        momentum: distance beyond the outer edge of the sole at which the CT-ZMP may be [m].
        arrived: distance of the DCM from its rest at which a weight shift is complete [m].
        narrow: whether the sole is too narrow for a push outwards wherever the ZMP rests.
    """

    sizes: tuple[Point, Point]
    margin: float
    arrived: float
    inwards: float = 0.0
    inner: float = 0.0
    outer: float = 0.0
    momentum: float = _MOMENTUM
    narrow: bool = False

    def rest(self, foot: int, place: Vector3, rotation: Rotation) -> Point:
        """Return the rest of the ZMP on a foot that carries alone [m]."""
        return _beside(place, rotation, inner_side(foot) * self.inwards)

    def arriving(self, foot: int, place: Vector3, rotation: Rotation) -> Point:
        """Return the goal of the ZMP in a weight shift to a foot, further outwards [m]."""
        return _beside(place, rotation, inner_side(foot) * _ARRIVING * self.inwards)

    def support(self, foot: int, place: Vector3, rotation: Rotation) -> SupportPolygon:
        """Return the sole, less the margin."""
        part = SolePart(0.0, 0.0, *self.sizes[foot])
        return one_sole(part, place, rotation, self.margin)

    def held(self, foot: int, place: Vector3, rotation: Rotation) -> SupportPolygon:
        """Return where the DCM is held."""
        part = self._widened(foot, self.sizes[foot], self.inner, self.outer)
        return one_sole(part, place, rotation, self.margin)

    def asked(self, foot: int, place: Vector3, rotation: Rotation) -> SupportPolygon:
        """Return where the CT-ZMP may be asked for: beyond the outer edge of a narrow sole only."""
        length, width = self.sizes[foot]
        size = (length + 2.0 * _MOMENTUM, width)
        inner = -_INNER_MARGIN if self.narrow else _MOMENTUM
        part = self._widened(foot, size, inner, self.momentum)
        return one_sole(part, place, rotation, 0.0)

    def caught(self, foot: int, place: Vector3, rotation: Rotation) -> list[Point] | None:
        """Return corners of the foothold that a swing foot offers beside a narrow sole [m]."""
        if not self.narrow:
            return None
        part = SolePart(0.0, _ANNOUNCED * inner_side(foot) * self.inwards, *self.sizes[foot])
        return part.corners(place, rotation, 0.0)

    def _widened(self, foot: int, size: Point, inner: float, outer: float) -> SolePart:
        length, width = size
        middle = 0.5 * inner_side(foot) * (inner - outer)
        return SolePart(0.0, middle, length, width + inner + outer)


def single_support_region(robot: Robot, omega: float, margin: float) -> SingleSupportRegion:
    """Return the region of a robot, by the width of its soles."""
    left, right = ((sole.length, sole.width) for sole in robot.soles.values())
    half = 0.5 * min(left[1], right[1])
    plain = SingleSupportRegion(
        sizes=(left, right), margin=margin, arrived=0.25 * min(*left, *right)
    )
    missing = _PUSH / omega + margin - half
    inwards = _INWARDS_MAX * half
    if missing <= 0.0:
        return plain
    if missing <= inwards:
        return replace(plain, inwards=missing)
    return replace(
        plain,
        # Nearer to the inner edge than the CT-ZMP gets the DCM would only go on.
        arrived=min(plain.arrived, half - _INNER_MARGIN - _ARRIVING * inwards),
        inwards=inwards,
        inner=max(inwards + _STRAY - (half - margin), 0.0),
        outer=margin + _OUTER,
        momentum=margin + _ASKED,
        narrow=True,
    )


def inner_side(foot: int) -> float:
    """Return the side of a foot on which the other one is: 1 for its left."""
    return 1.0 if foot == 1 else -1.0


def _beside(place: Vector3, rotation: Rotation, left: float) -> Point:
    (x, y, _), (along_x, along_y) = place.tolist(), rotation[:2, 1].tolist()
    return x + left * along_x, y + left * along_y
