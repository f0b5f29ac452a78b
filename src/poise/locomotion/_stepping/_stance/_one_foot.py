"""`OneFoot`: where the robot balances on one foot, and what holds it there."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise.locomotion._support import Point, SolePart
from poise.robots import Robot

_PUSH, _MOST = 0.2, 0.65
"""A push outwards that one foot shall hold [m/s], and how far beside the middle of the sole the ZMP
may rest for that, over half its width."""

_STRAY = 0.013
"""So far from its reference the divergent component comes on bumps, with an attitude that is off
and noise of sensors: a foot put down for that would never stay up [m]."""

_CAUGHT, _ASKED = 0.0275, 0.0525
"""How far beyond a narrow sole's outer edge the divergent component is held by what trunk, arms and
leg give, and how far the CT-ZMP is asked beyond for that [m]."""

PLAIN = 0.01
"""The latter for any other sole [m]."""

_KEPT = 0.006
"""How far inside a narrow sole's inner edge the CT-ZMP stays: contacts keep the pressure some
millimetres from it, and whatever is asked beyond is made up for by the trunk, which leans more and
more [m]."""

_UPRIGHT = 0.1
"""How far outwards the ZMP rests for each radian that the trunk leans inwards [m/rad]."""

_ARRIVING = 0.6
"""Part of that way beside the middle for which a shift aims. Aiming for all of it, G1 was lifted
where its divergent component was as near to the inner edge as the CT-ZMP gets, with nothing left to
brake what the other leg's swing did to it, and with noise alone the foot came down again by itself
in 4 of 18 tries."""

_ANNOUNCED = 0.7
"""How far inwards the foot in the air catches the robot, over how far the ZMP rests there."""


class OneFoot(NamedTuple):
    """Where weight and momentum are kept while one foot carries the robot alone.

    Pushed inwards, the foot in the air comes down where it is and holds the robot; pushed outwards
    it would have to cross the other leg. So where a push outwards takes more than half of a sole
    the ZMP rests on its inner side. On one that is too narrow even for that, what is still missing
    is made up for by angular momentum: on its outer side the robot leans before it steps. A trunk
    that leans inwards, and arms and leg that have been thrown, need room on both sides to come
    back, and where the ZMP rests near the inner edge there is none: it moves to the middle
    meanwhile.

    Attributes:
        inwards: how far beside the middle of the sole the ZMP rests, to the side of the other foot
            [m].
        inner: how far beyond the edge of its support on that side the divergent component may be
            before the robot steps [m].
        outer: likewise on the other side [m].
        momentum: how far beyond the outer edge of the sole the CT-ZMP may be, for a while [m].
        arrival: how far inwards of where the ZMP rests the divergent component may be when the
            other foot is lifted [m].
        narrow: whether the sole is too narrow for a push outwards wherever the ZMP rests.
    """

    inwards: float = 0.0
    inner: float = 0.0
    outer: float = 0.0
    momentum: float = PLAIN
    arrival: float = math.inf
    narrow: bool = False

    def zmp(
        self,
        foot: int,
        place: Float64[np.ndarray, "3"],
        rotation: Float64[np.ndarray, "3 3"],
        leaning: float = 0.0,
        borrowed: float = 0.0,
    ) -> Float64[np.ndarray, "2"]:
        """Where the ZMP shall be on a foot that carries alone [m].

        Args:
            foot: 0 left, 1 right.
            place: of its sole [m].
            rotation: world_R_sole.
            leaning: of the trunk, to the side of the other foot [rad].
            borrowed: how much trunk, arms and leg have given lately, from 0 to 1.
        """
        inwards = self.inwards
        if self.narrow:
            inwards -= min(_UPRIGHT * max(leaning, 0.0), inwards)
            inwards *= 1.0 - borrowed
        return _beside(place, rotation, inner_side(foot) * inwards)

    def arriving(
        self, foot: int, place: Float64[np.ndarray, "3"], rotation: Float64[np.ndarray, "3 3"]
    ) -> Float64[np.ndarray, "2"]:
        """Where the ZMP shall be while the weight comes over a foot: further outwards [m].

        Args:
            foot: 0 left, 1 right.
            place: of its sole [m].
            rotation: world_R_sole.
        """
        return _beside(place, rotation, inner_side(foot) * _ARRIVING * self.inwards)

    def holds(self, foot: int, size: Point) -> SolePart:
        """Where on the ground, along its sole, the divergent component is held.

        Args:
            foot: 0 left, 1 right.
            size: length and width of the sole [m].
        """
        return _widened(foot, size, self.inner, self.outer)

    def asks(self, foot: int, size: Point) -> SolePart:
        """Where the CT-ZMP may be asked for, along its sole: beyond the outer edge alone.

        Beyond the inner one the foot in the air comes down.

        Args:
            foot: 0 left, 1 right.
            size: length and width of the sole [m].
        """
        length, width = size
        return _widened(foot, (length + 2.0 * PLAIN, width), -_KEPT, self.momentum)

    def caught(self, foot: int, size: Point) -> SolePart | None:
        """Where the foot in the air would catch the robot, along the sole of the one that stands.

        Args:
            foot: that stands, 0 left, 1 right.
            size: length and width of its sole [m].

        Returns:
            The sole, moved inwards; None where the robot holds a push on what it stands on.
        """
        if not self.narrow:
            return None
        return SolePart(0.0, _ANNOUNCED * inner_side(foot) * self.inwards, *size)


WIDE = OneFoot()
"""On a sole that is wide enough."""


def one_foot(robot: Robot, omega: float, margin: float) -> OneFoot:
    """How a robot stands on one foot, by how wide its soles are.

    Args:
        robot: with soles.
        omega: sqrt(g / H) [1/s].
        margin: how far from the soles' edges support ends [m].
    """
    half = 0.5 * min(sole.width for sole in robot.soles.values())
    missing = _PUSH / omega + margin - half
    if missing <= 0.0:
        return WIDE
    inwards = _MOST * half
    if missing <= inwards:
        return OneFoot(inwards=missing)
    return OneFoot(
        inwards=inwards,
        inner=max(inwards + _STRAY - (half - margin), 0.0),
        outer=margin + _CAUGHT,
        momentum=margin + _ASKED,
        # Lifted when it is nearer to the inner edge than the ZMP gets, it would only go on.
        arrival=half - _KEPT - inwards,
        narrow=True,
    )


def inner_side(foot: int) -> float:
    """On which side of a foot the other one is: 1 for its left.

    Args:
        foot: 0 left, 1 right.
    """
    return 1.0 if foot == 1 else -1.0


def _beside(
    place: Float64[np.ndarray, "3"], rotation: Float64[np.ndarray, "3 3"], left: float
) -> Float64[np.ndarray, "2"]:
    """A place on the ground so far to the left of a sole's middle, as the sole is turned [m]."""
    (x, y, _), (along_x, along_y) = place.tolist(), rotation[:2, 1].tolist()
    return np.array([x + left * along_x, y + left * along_y])


def _widened(foot: int, size: Point, inner: float, outer: float) -> SolePart:
    """A sole that is wider on both sides [m]."""
    length, width = size
    return SolePart(0.0, 0.5 * inner_side(foot) * (inner - outer), length, width + inner + outer)
