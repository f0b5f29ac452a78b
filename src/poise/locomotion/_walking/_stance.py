"""`Stance`: where the feet stand, on what slope, and what the ZMP can do there."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from poise.locomotion._support import Point, SolePart, SupportPolygon, both_soles
from poise.locomotion._walking._carrying import CarryingArea
from poise.locomotion._walking._footsteps import Stand
from poise.locomotion._walking._sense import WalkSense

_CLOSED, _CLOSED_TURN = 0.025, 0.06
"""Feet so near to side by side are [m, rad]."""

_DRIFT = 0.002
"""Feet that seem to have moved by more than this stand elsewhere [m]."""

_TRUST = 0.5
"""How far the slope goes towards that of a foot that has come to carry the robot: one foot may
stand on a bump, three in a row do not."""

_STEEPEST = 0.2
"""A sole that is turned farther than this against the slope so far stands on an edge."""


class Stance:
    """Both feet: where they stand, or stood before they were lifted.

    The ground is a plane through the foot that stands, whose slope is learned from the soles:
    one that carries the robot alone lies flat on what it has met.

    Attributes:
        feet: where both stand; a foot in the air where it stood.
        slope: how steeply the ground rises along the world's x and y.
        support: where the ZMP can be.
        parts: loaded area of each sole as estimated; None for all of it.
    """

    def __init__(
        self,
        sense: WalkSense,
        stand: Stand,
        margin: float,
        areas: Sequence[CarryingArea],
    ) -> None:
        self._sense, self._stand, self._margin = sense, stand, margin
        self._areas = areas
        self.feet = list(stand.start)
        self.slope: Point = (0.0, 0.0)
        self.support = SupportPolygon([], 0.0)
        self.parts: list[SolePart | None] = [None, None]
        self._feet: tuple[int, ...] = ()
        self._seen: list[SolePart | None] = [None, None]

    def stand_on(self, feet: tuple[int, ...], heading: float) -> None:
        """Looks at the feet that carry the robot from now on."""
        # A sole that leans with its leg says nothing of the ground.
        foot, *others = feet
        if not others and self._stand.bearings[foot].width > 0.0 and self._areas[foot].lies:
            self._feel(self._sense.sole(foot)[1])
        for foot in feet:
            place = self._sense.placement(foot)
            turns = round((heading - place.yaw) / (2.0 * math.pi))
            yaw = place.yaw + 2.0 * math.pi * turns
            self.feet[foot] = replace(place, yaw=yaw, slope=self.slope)
        self._feet = feet
        self._look(self.parts)

    def refresh(self) -> None:
        """Update the support polygon of two soles, where only a part of one carries, or did."""
        parts = self.parts = self._estimated_parts()
        if len(self._feet) == 2 and not parts == self._seen == [None, None]:
            self._look(parts)

    def _look(self, parts: list[SolePart | None]) -> None:
        self._seen = parts
        sense, stand, (foot, *others) = self._sense, self._stand, self._feet
        if others:
            both = [sense.sole(0), sense.sole(1)]
            self.support = both_soles(both, stand.sizes, self._margin, parts)
        else:
            corners = stand.bearings[foot].corners(*sense.sole(foot), self._margin)
            self.support = SupportPolygon(corners, 0.0)

    def _estimated_parts(self) -> list[SolePart | None]:
        """What of each sole carries, as far as is known; None for all of it."""
        (left, right), sizes = self._areas, self._stand.sizes
        return [left.part(sizes[0]), right.part(sizes[1])]

    def follow(self, heading: float) -> None:
        """Looks again at two feet that stand, once they seem to have moved.

        Where the state is estimated the world drifts under a robot that stands, millimetres in a
        second, and with it everything but what was remembered of the feet.
        """
        for foot, place in enumerate(self.feet):
            x, y, _ = self._sense.positions[foot]
            if math.dist((x, y), place.position[:2]) > _DRIFT:
                self.stand_on((0, 1), heading)
                return

    def _feel(self, rotation: Float64[np.ndarray, "3 3"]) -> None:
        """Learns from a sole that lies on the ground, world_R_sole."""
        x, y, z = rotation[:, 2].tolist()
        seen = (-x / z, -y / z)
        if math.dist(seen, self.slope) < _STEEPEST:
            a, b = (old + _TRUST * (new - old) for old, new in zip(self.slope, seen, strict=True))
            self.slope = (a, b)

    def bearing(self, foot: int) -> SolePart:
        """Where the ZMP can be while a foot alone carries the robot, as far as is known."""
        return self._areas[foot].bearing(self._stand.bearings[foot])

    @property
    def heading(self) -> float:
        """Mean of both feet's [rad]."""
        return 0.5 * (self.feet[0].yaw + self.feet[1].yaw)

    def closed(self, width: float) -> bool:
        """Return whether the feet are side by side."""
        left, right = self.feet
        yaw = self.heading
        dx, dy = (left.position[k] - right.position[k] for k in (0, 1))
        ahead = math.cos(yaw) * dx + math.sin(yaw) * dy
        aside = math.cos(yaw) * dy - math.sin(yaw) * dx
        return (
            abs(ahead) < _CLOSED
            and abs(aside - width) < _CLOSED
            and abs(left.yaw - right.yaw) < _CLOSED_TURN
        )
