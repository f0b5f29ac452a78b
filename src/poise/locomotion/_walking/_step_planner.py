"""`StepPlanner`: the next few steps of a command, and the pendulum's motion for them."""

import math
from collections.abc import Sequence
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
from poise.locomotion._walking._legs import LegRoom
from poise.locomotion._walking._step_choice import (
    LastStep,
    Pendulum,
    Step,
    SwingLimits,
    choose_step,
)

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
        """For how long a foot in the air counts as swung, by how soon it can be down [s]."""
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
        seen = pendulum._replace(
            xi=axes.within(pendulum.xi),
            zmp=axes.within(pendulum.zmp),
            zmp_end=axes.within(pendulum.zmp_end),
            goal=axes.within(pendulum.goal),
            foothold=axes.within(pendulum.foothold),
        )
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
