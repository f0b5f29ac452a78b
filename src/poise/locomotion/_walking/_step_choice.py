"""Choice of the next touchdown from the measured DCM: `choose_step`, `StepBounds`, `LastStep`."""

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


class StepBounds(NamedTuple):
    """Where a foot may come down, along the foot that stands and away from it.

    Attributes:
        back: farthest behind, negative [m].
        ahead: farthest ahead [m].
        near: nearest beside, so that feet neither cross nor touch [m].
        wide: farthest beside [m].
        reach: farthest from the place `beside` [m].
        beside: where it is side by side, half way between what is near and comfortable [m].
    """

    back: float
    ahead: float
    near: float
    wide: float
    reach: float
    beside: float

    def nearest(self, place: Point) -> Point:
        """The nearest place inside; the second coordinate counts away from the foot that stands."""
        x, y = place
        distance = math.hypot(x, max(y - self.beside, 0.0))
        if distance > self.reach:
            ratio = self.reach / distance
            x *= ratio
            if y > self.beside:
                y = self.beside + ratio * (y - self.beside)
        return min(max(x, self.back), self.ahead), min(max(y, self.near), self.wide)


class Step(NamedTuple):
    """A choice.

    Attributes:
        x: of the foothold, along the foot that stands [m].
        y: away from it, to the side of the foot in the air [m].
        left: until touchdown [s].
        off: how far the divergent component will be from where it should be then, along the foot
            that stands and away from it [m].
        effort: what deviations of place and time cost.
    """

    x: float
    y: float
    left: float
    off: Point
    effort: float

    @property
    def missed(self) -> float:
        """How far the divergent component will be from where it should be at touchdown [m]."""
        return math.hypot(*self.off)

    @property
    def cost(self) -> float:
        """Of the choice."""
        return self.effort + (self.missed / _DCM) ** 2


class Pendulum(NamedTuple):
    """What a choice is made from, along the foot that stands and away from it.

    Attributes:
        xi: the divergent component, measured [m].
        zmp: where the ZMP should be now [m].
        zmp_end: and at touchdown, evenly in between [m].
        goal: where it should be at touchdown if the foothold is as planned [m].
        foothold: as planned [m].
        gain: how far the goal moves with the foothold.
        room: of the ZMP, beside where it should be, along the foot and across it [m].
        omega: natural frequency [1/s].
        last: what counts in place of `goal` where both feet stay afterwards.
    """

    xi: Point
    zmp: Point
    zmp_end: Point
    goal: Point
    foothold: Point
    gain: float
    room: Point
    omega: float
    last: LastStep | None = None


class SwingLimits(NamedTuple):
    """What the foot in the air can do.

    Attributes:
        place: where it is now [m].
        speed: on average, at most [m/s].
        elapsed: since lift-off [s].
        shortest: swing [s].
        usual: swing [s].
        longest: swing [s].
    """

    place: Point
    speed: float
    elapsed: float
    shortest: float
    usual: float
    longest: float


_CANDIDATES = 13
"""Times of touchdown that are looked at."""

_SOONEST = 0.02
"""A foot that is due comes down within this time [s]."""

_PLACE, _TIME, _DCM = 0.1, 0.15, 0.01
"""Deviations of foothold [m], time [s] and divergent component at touchdown [m] that cost one."""


def choose_step(pendulum: Pendulum, bounds: StepBounds, swing: SwingLimits) -> Step:
    """The touchdown that costs least.

    For every time tau until touchdown, with E = e^{omega tau}, the ZMP takes the divergent
    component to r_1 + s + E (xi - r_0 - s), s = (r_1 - r_0) / (omega tau), and r (1 - E) farther
    where it is r beside that. It does what it can within the sole; the foothold moves for the rest,
    within reach; what is left is missed. Deviations of place, time and divergent component are
    weighed against each other, in the manner of Khadiv et al. (2020). After a last step any place
    of the divergent component between the feet will do.
    """
    best: Step | None = None
    usual = swing.usual - swing.elapsed
    if usual >= _SOONEST:
        best = _at(usual, pendulum, bounds, swing)
        if best.cost == 0.0:
            return best
    span = swing.longest - swing.shortest
    for k in range(_CANDIDATES):
        left = swing.shortest + span * k / (_CANDIDATES - 1) - swing.elapsed
        if left < _SOONEST and k < _CANDIDATES - 1:
            continue
        step = _at(max(left, _SOONEST), pendulum, bounds, swing)
        if best is None or step.cost < best.cost:
            best = step
    assert best is not None
    return best


def _at(left: float, pendulum: Pendulum, bounds: StepBounds, swing: SwingLimits) -> Step:
    """The best foothold for one time until touchdown."""
    product = pendulum.omega * left
    growth = math.exp(product)
    xi_x, xi_y = (
        end + (end - start) / product + growth * (xi - start - (end - start) / product)
        for xi, start, end in zip(pendulum.xi, pendulum.zmp, pendulum.zmp_end, strict=True)
    )
    room_x, room_y = pendulum.room
    reached = (room_x * (growth - 1.0), room_y * (growth - 1.0))
    planned_x, planned_y = pendulum.foothold
    last, gain = pendulum.last, pendulum.gain
    goal_x, goal_y = pendulum.goal
    off = (beyond(xi_x - goal_x, reached[0]), beyond(xi_y - goal_y, reached[1]))
    if last is None:
        by_x, by_y = off[0] / gain, off[1] / gain
    else:
        by_x, by_y = last.move((xi_x, xi_y), pendulum.foothold, reached)
    x, y = bounds.nearest((planned_x + by_x, planned_y + by_y))
    x, y = _within_reach((x, y), swing, left)
    by_x, by_y = x - planned_x, y - planned_y
    if last is None:
        off_there = (off[0] - gain * by_x, off[1] - gain * by_y)
    else:
        off_there = last.off((xi_x, xi_y), (x, y), reached)
    late = swing.elapsed + left - swing.usual
    effort = (by_x * by_x + by_y * by_y) / _PLACE**2 + (late / _TIME) ** 2
    return Step(x, y, left, off_there, effort)


def _within_reach(place: Point, swing: SwingLimits, left: float) -> Point:
    """The nearest place that the foot gets to in time."""
    x, y = place[0] - swing.place[0], place[1] - swing.place[1]
    distance, most = math.hypot(x, y), swing.speed * left
    if distance <= most:
        return place
    return swing.place[0] + x * most / distance, swing.place[1] + y * most / distance
