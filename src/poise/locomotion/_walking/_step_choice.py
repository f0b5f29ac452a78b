"""Choice of the next touchdown from the measured DCM: `choose_step`, `StepBounds`, `LastStep`."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from poise.locomotion._support import Point

_BETWEEN = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)
"""Points between the feet, as parts of the way to the foothold: those nearer to it would put all
load on the foot that has just landed."""

_ALONG = 0.1
"""A point between the feet that goes along with the foothold by less than this is not moved."""


class LastStep(NamedTuple):
    """A step after which both feet stay: they hold the robot wherever it is between them."""

    beta: float  # how heavy each leg is, see `LegMomentum`
    room: Point  # in each sole, along the stance foot and across it [m]

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
    """Bounds of a foothold, along the stance foot and away from it."""

    near: float  # nearest beside, so that feet neither cross nor touch [m]
    wide: float  # farthest beside [m]
    reach: float  # farthest ahead and behind, and from the place `beside` [m]
    beside: float  # where it is side by side, half way between what is near and comfortable [m]

    def nearest(self, place: Point) -> Point:
        """The nearest place inside; the second coordinate counts away from the stance foot."""
        x, y = place
        distance = math.hypot(x, max(y - self.beside, 0.0))
        if distance > self.reach:
            ratio = self.reach / distance
            x *= ratio
            if y > self.beside:
                y = self.beside + ratio * (y - self.beside)
        return x, min(max(y, self.near), self.wide)


class Step(NamedTuple):
    x: float  # of the foothold, along the stance foot [m]
    y: float  # away from it, to the side of the swing foot [m]
    left: float  # until touchdown [s]
    # of the DCM from its goal then, along the stance foot and away from it [m]
    off: Point
    effort: float  # what deviations of place and time cost

    @property
    def missed(self) -> float:
        """Distance of the DCM from its goal at touchdown [m]."""
        return math.hypot(*self.off)

    @property
    def cost(self) -> float:
        return self.effort + (self.missed / _DCM) ** 2


class Pendulum(NamedTuple):
    """State and plan of the pendulum, along the stance foot and away from it."""

    xi: Point  # the DCM, measured [m]
    zmp: Point  # where the ZMP should be now [m]
    zmp_end: Point  # and at touchdown, evenly in between [m]
    goal: Point  # where it should be at touchdown if the foothold is as planned [m]
    foothold: Point  # as planned [m]
    gain: float  # how far the goal moves with the foothold
    room: Point  # of the ZMP, beside where it should be, along the foot and across it [m]
    omega: float  # natural frequency [1/s]
    last: LastStep | None = None  # what counts in place of `goal` where both feet stay afterwards


class SwingLimits(NamedTuple):
    place: Point  # where it is now [m]
    speed: float  # on average, at most [m/s]
    elapsed: float  # since lift-off [s]
    shortest: float  # swing [s]
    usual: float  # swing [s]
    longest: float  # swing [s]


_CANDIDATES = 13
"""Times of touchdown that are looked at."""

_SOONEST = 0.02
"""A foot that is due comes down within this time [s]."""

_PLACE, _TIME, _DCM = 0.1, 0.15, 0.01
"""Deviations of foothold [m], time [s] and divergent component at touchdown [m] that cost one."""


def choose_step(pendulum: Pendulum, bounds: StepBounds, swing: SwingLimits) -> Step:
    """Return the touchdown that costs least, in the manner of Khadiv et al. (2020)."""
    # For every time tau until touchdown, with E = e^{omega tau}, the ZMP takes the DCM to
    # r_1 + s + E (xi - r_0 - s), s = (r_1 - r_0) / (omega tau), and r (1 - E) farther where it is r
    # beside that. It does what it can within the sole; the foothold moves for the rest, within
    # reach, and the remainder is missed. After a last step any place between the feet will do.
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
