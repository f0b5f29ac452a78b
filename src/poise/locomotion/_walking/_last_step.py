"""`LastStep`: a step after which both feet stay, and what that asks of its foothold."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from poise.locomotion._support import Point

_BETWEEN = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)
"""Points between the feet that are looked at, as parts of the way to the foothold: over what is
nearer to the foot that has just landed, that would have to carry all at once."""

_ALONG = 0.1
"""A point between the feet that goes along with the foothold by less than this is not moved."""


class LastStep(NamedTuple):
    """A step after which both feet stay: they hold the robot wherever it is between them.

    Two soles that lie alike hold the divergent component of motion within a sole's room of any
    point of the line between them. So the foothold need not move for a component that is somewhere
    on the way; else it moves the least way that takes the line to it.

    Attributes:
        beta: how heavy each leg is, see `LegMomentum`.
        room: in each sole, along the foot that stands and across it [m].
    """

    beta: float
    room: Point

    def move(self, xi: Point, foothold: Point, reached: Point) -> Point:
        """Return the shift of the foothold with which both feet hold the robot [m]."""
        best, least = (0.0, 0.0), math.inf
        for share, (x, y) in self._misses(xi, foothold, reached):
            far = math.hypot(x, y)
            if far == 0.0:
                return 0.0, 0.0
            if share > _ALONG and far / share < least:
                best, least = (x / share, y / share), far / share
        return best

    def off(self, xi: Point, foothold: Point, reached: Point) -> Point:
        """Return the distance of the DCM from where both feet hold it [m]."""
        misses = (miss for _, miss in self._misses(xi, foothold, reached))
        return min(misses, key=lambda miss: math.hypot(*miss))

    def _misses(self, xi: Point, foothold: Point, reached: Point) -> Iterator[tuple[float, Point]]:
        """By how much each point goes along with the foothold, and its way to xi, less the room."""
        (x, y), (to_x, to_y) = xi, foothold
        room_x, room_y = self.room[0] + reached[0], self.room[1] + reached[1]
        for part in _BETWEEN:
            # Of `LegMomentum.joined`, as everything that a step is chosen from.
            share = part * (1.0 + 2.0 * self.beta) - self.beta
            yield share, (beyond(x - share * to_x, room_x), beyond(y - share * to_y, room_y))


def beyond(miss: float, most: float) -> float:
    """Return a miss less what the ZMP makes up for [m]."""
    return math.copysign(max(abs(miss) - most, 0.0), miss)
