"""`StepPlanner`: the next few steps of a command, and the choice of the next touchdown."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from poise.locomotion._support import Point, SolePart, side
from poise.locomotion._walking._commands import FootAxes, StepCommands
from poise.locomotion._walking._dcm import (
    DcmMotions,
    LegMomentum,
    StepTimes,
    before_transfer,
    touchdown_dcm,
    transfer_gain,
)
from poise.locomotion._walking._footsteps import Stand
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._legs import LegRoom, StepBounds

_BETWEEN = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)
"""Points between the feet, as parts of the way to the foothold: those nearer to it would put all
load on the foot that has just landed."""

_ALONG = 0.1
"""A point between the feet that follows the foothold by less than this is not moved."""


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
        """Share of each point in a shift of the foothold, and its distance to xi less margin."""
        (x, y), (to_x, to_y) = xi, foothold
        room_x, room_y = self.room[0] + reached[0], self.room[1] + reached[1]
        for part in _BETWEEN:
            # Of `LegMomentum.joined`, as everything that a step is chosen from.
            share = part * (1.0 + 2.0 * self.beta) - self.beta
            yield share, (beyond(x - share * to_x, room_x), beyond(y - share * to_y, room_y))


def beyond(miss: float, most: float) -> float:
    """Return the error that remains after the correction by the ZMP [m]."""
    return math.copysign(max(abs(miss) - most, 0.0), miss)


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


_SOONEST = 0.02
"""Least time until the touchdown of a foot that is due [s]."""

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
    last, span = 12, swing.longest - swing.shortest
    for k in range(last + 1):
        left = swing.shortest + span * k / last - swing.elapsed
        if left < _SOONEST and k < last:
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


QUICK = 0.04
"""From the decision to step in order not to fall to lift-off [s]."""

_SHORTEST, _LONGEST = 0.4, 1.5
"""Shortest and longest swing over the usual one."""

_TRUSTED = 0.6
"""Part of a sole that the choice of a step takes the ZMP to reach; the rest is for feedback."""

_FALL = 0.3
"""Over its height, the square of the time that a foot in the air takes to come down [s^2/m]: faster
it would take the load off the one that carries."""

AHEAD = 4
"""Footholds that are looked at."""


class Lifted(NamedTuple):
    """Swing foot, now or next."""

    foot: int  # 0 for the left one, 1 for the right one
    place: Point  # where it is now [m]
    stance: Placement  # where the other one stands
    bearing: SolePart  # where in that one the ZMP can be
    xi: Point  # the DCM, measured [m]
    elapsed: float = 0.0  # since lift-off [s]

    @property
    def zmp(self) -> Point:
        """Rest of the ZMP during the swing [m]."""
        return self.bearing.rest_at(self.stance.position[:2], self.stance.yaw)


class StepPlanner:
    """Planner of the next few steps from a command, and of the next touchdown."""

    def __init__(
        self,
        commands: StepCommands,
        room: LegRoom,
        legs: LegMomentum,
        times: StepTimes,
        margin: float,
        stand: Stand,
    ) -> None:
        self._stand = stand
        self._commands, self._room, self._legs, self.times = commands, room, legs, times
        self._margin, self._gain = margin, transfer_gain(legs, times)
        self._asked: tuple[Sequence[Placement], int | None, SolePart | None] = ((), None, None)
        self._planned: Pendulum
        # As fast as the hips move a foot: side by side at least, and as far as it goes at most.
        self._shortest = max(_SHORTEST * times.swing, room.shortest_swing(room.width))
        self._speed = room.far / room.shortest_swing(room.far)

    def swung(self, height: float) -> float:
        """Effective time in swing of a foot, from its earliest touchdown [s]."""
        shortest = min(self._shortest, self.times.swing)
        return shortest - math.sqrt(_FALL * max(height, 0.0))

    def plan(self, lifted: Lifted, counts_as: Point | None = None) -> Pendulum:
        """Return the pendulum of the next footholds, in the world."""
        steps = self._commands.steps(lifted.foot, lifted.stance, AHEAD)
        asked = (steps, self._commands.left, lifted.bearing)
        if steps is not self._asked[0] or asked[1:] != self._asked[1:]:
            self._asked, self._planned = asked, self._plan(lifted, steps, self._commands.left)
        there = self._planned.zmp
        zmp = self._legs.joined(there, (there, counts_as or lifted.place))
        return self._planned._replace(xi=lifted.xi, zmp=zmp)

    def _plan(self, lifted: Lifted, steps: Sequence[Placement], left: int | None) -> Pendulum:
        """Plan what depends neither on the state nor on the swing foot."""
        stance, legs, steps = lifted.zmp, self._legs, steps[:left]
        foothold = steps[0].position[:2]
        feet = (lifted.foot, 1 - lifted.foot)
        rests = [self._stand.zmp(feet[i % 2], step) for i, step in enumerate(steps)]
        rest: Point | None = None
        if len(steps) == left:
            (ax, ay), (bx, by) = (stance, *rests)[-2:]
            rest = 0.5 * (ax + bx), 0.5 * (ay + by)
        along, across = lifted.bearing.room
        trusted = _TRUSTED * legs.factor
        room = (
            trusted * max(along - self._margin, 0.0),
            trusted * max(across - self._margin, 0.0),
        )
        return Pendulum(
            xi=lifted.xi,
            zmp=stance,
            zmp_end=legs.joined(stance, (stance, foothold)),
            goal=touchdown_dcm((stance, *rests), legs, self.times, rest),
            foothold=foothold,
            gain=self._gain,
            room=room,
            omega=legs.omega,
            last=LastStep(legs.beta, room) if len(steps) == left == 1 else None,
        )

    def moved(self, pendulum: Pendulum, foothold: Point) -> Pendulum:
        """Return the last plan with another foothold, and all after it as far beside their plan."""
        there, gain, (x, y), (to_x, to_y) = self._planned.zmp, self._gain, pendulum.goal, foothold
        goal = x + gain * (to_x - pendulum.foothold[0]), y + gain * (to_y - pendulum.foothold[1])
        end = self._legs.joined(there, (there, foothold))
        return pendulum._replace(goal=goal, zmp_end=end, foothold=foothold)

    def on_the_way(self, pendulum: Pendulum, left: float) -> DcmMotions:
        """Return the DCM reference in single support, a time before its goal."""
        start, end, omega = pendulum.zmp, pendulum.zmp_end, pendulum.omega
        now = pendulum.goal
        if left > 0.0:
            now = before_transfer(pendulum.goal, start, end, omega, left)
        (x, y), (zmp_x, zmp_y) = now, start
        return (x, omega * (x - zmp_x)), (y, omega * (y - zmp_y))

    def choose(self, lifted: Lifted, pendulum: Pendulum, turned: float) -> tuple[Step, Point]:
        """Return the best touchdown of a plan, and where that is in the world [m]."""
        axes, usual = FootAxes(lifted.stance, side(lifted.foot)), self.times.swing
        points = ("xi", "zmp", "zmp_end", "goal", "foothold")
        seen = pendulum._replace(**{k: axes.within(getattr(pendulum, k)) for k in points})
        limits = SwingLimits(
            place=axes.within(lifted.place),
            speed=self._speed,
            elapsed=lifted.elapsed,
            shortest=min(self._shortest, usual),
            usual=usual,
            longest=_LONGEST * usual,
        )
        step = choose_step(seen, self._room.bounds(turned, far=True), limits)
        return step, axes.without((step.x, step.y))

    def cost(self, lifted: Lifted) -> float:
        """Return the cost of a step that begins now."""
        return self.choose(lifted, self.plan(lifted), 0.0)[0].cost

    def better_foot(
        self, feet: Sequence[Placement], bearings: Sequence[SolePart], xi: Point
    ) -> int:
        """The foot whose step, and the other one's after it, catch the robot at the least cost."""
        costs: list[float] = []
        for foot in (0, 1):
            other = 1 - foot
            lifted = Lifted(foot, feet[foot].position[:2], feet[other], bearings[other], xi)
            step, landed = self._step_at_once(lifted)
            following, _ = self._step_at_once(landed)
            costs.append(step.effort + following.cost)
        return int(costs[1] < costs[0])

    def _step_at_once(self, lifted: Lifted) -> tuple[Step, Lifted]:
        """The best step that begins as soon as it can, and the other foot when it has landed."""
        pendulum, stance = self.plan(lifted), lifted.stance
        growth = math.exp(self._legs.omega * QUICK)
        # Until lift-off the ZMP gets to the foot that stays, and the rest grows.
        x, y = (z + growth * (p - z) for p, z in zip(lifted.xi, pendulum.zmp, strict=True))
        step, place = self.choose(lifted, pendulum._replace(xi=(x, y)), 0.0)
        goal = self.moved(pendulum, place).goal
        off = FootAxes(stance, side(lifted.foot)).turned(step.off)
        landed = replace(stance, position=(*place, stance.position[2]))
        x, y = (there + by for there, by in zip(goal, off, strict=True))
        bearing = self._stand.bearings[lifted.foot]
        return step, Lifted(1 - lifted.foot, stance.position[:2], landed, bearing, (x, y))
