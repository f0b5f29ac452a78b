"""Commands of a walk, as the next footholds, and their limits."""

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

from poise._schema import Bounds, checked
from poise.locomotion._support import Point, side
from poise.locomotion._walking._footsteps import LARGEST, FootstepPlan, level_place
from poise.locomotion._walking._ground import LEVEL, Ground, Placement, wrapped
from poise.locomotion._walking._legs import LegRoom

_Speed = Annotated[float, Bounds(least=0.0, most=LARGEST, unit="m/s")]


@checked()
@dataclass(frozen=True, kw_only=True)
class VelocityLimits:
    """Largest velocities of a robot, and their rate of change.

    Velocities that go together share what there is: their ratios to these limits are the
    coordinates of a point in the unit ball.

    Attributes:
        ahead: [m/s].
        back: [m/s].
        sideways: [m/s].
        turn: [rad/s].
        rise_time: from standing to a limit, and back [s].
    """

    ahead: _Speed = 0.65
    back: _Speed = 0.4
    sideways: _Speed = 0.3
    turn: Annotated[float, Bounds(least=0.0, most=LARGEST, unit="rad/s")] = 0.8
    rise_time: Annotated[float, Bounds(positive=True, most=LARGEST, unit="s")] = 1.0


_ASKEW = 0.03
"""A foothold turned by less than this from the command is as commanded [rad]."""


def _outwards(foot: int, turn: float) -> float:
    """A turn of a foot against the other one, outwards, whole turns left out [rad]."""
    return side(foot) * wrapped(turn)


class FootAxes:
    """Along a foot that stands, and away from it to the side of the other one."""

    def __init__(self, stance: Placement, out: float) -> None:
        self._x, self._y, _ = stance.position
        self._cos, self._sin, self._out = math.cos(stance.yaw), math.sin(stance.yaw), out

    def within(self, point: Point) -> Point:
        """A point of the world, in the axes of the foot."""
        dx, dy = point[0] - self._x, point[1] - self._y
        along, left = self._cos * dx + self._sin * dy, self._cos * dy - self._sin * dx
        return along, self._out * left

    def without(self, point: Point) -> Point:
        """A point of the foot's axes, in the world."""
        x, y = self.turned(point)
        return self._x + x, self._y + y

    def turned(self, vector: Point) -> Point:
        """A vector of the foot's axes, in the world."""
        along, left = vector[0], self._out * vector[1]
        return self._cos * along - self._sin * left, self._sin * along + self._cos * left


class Foothold(NamedTuple):
    """Commanded foothold."""

    foot: int  # 0 for the left one, 1 for the right one
    place: Placement  # where its sole shall lie; the height is that of the ground
    checked: bool = False  # whether the legs are known to reach it from the foothold before
    turned: float = 0.0  # turn outwards that they are known to reach there [rad]


Velocity = tuple[float, float, float]
"""Ahead [m/s], to the left [m/s], turning to the left [rad/s]."""


class StepCommands:
    """Commanded velocities and footholds, as the next footholds."""

    def __init__(
        self, limits: VelocityLimits, room: LegRoom, step_time: float, ground: Ground
    ) -> None:
        self._room, self._time, self._ground = room, step_time, ground
        self._limits = limits
        self._wanted: Velocity = (0.0, 0.0, 0.0)
        self.velocity: Velocity = (0.0, 0.0, 0.0)  # that is followed now
        self.pace = 1.0  # part of the velocity asked for that is followed
        self.footholds: deque[Foothold] = deque()  # given and not yet made
        self.closes = True
        self.notice = ""  # what was cut or ignored of the last command; "" for nothing
        self._planned: tuple[tuple[object, ...], list[Placement]] = ((), [])

    def set_velocity(self, ahead: float, sideways: float, turn: float) -> None:
        """Set the commanded velocity; one that is not finite is ignored."""
        asked = (ahead, sideways, turn)
        if not all(math.isfinite(value) for value in asked):
            self.notice = f"velocity {_shown(asked)} ignored: not finite"
            return
        self._wanted = self._within_limits(asked)
        self.closes = True
        self.notice = ""
        if self._wanted != asked:
            self.notice = f"velocity {_shown(asked)} taken to {_shown(self._wanted)}"

    def stop(self) -> None:
        """Discard all commands and stand."""
        self._wanted = self.velocity = (0.0, 0.0, 0.0)
        self.footholds.clear()
        self.closes = True

    def add_foothold(self, foothold: Foothold) -> None:
        """Append a foothold; one not finite is ignored."""
        x, y, _ = foothold.place.position
        if not all(math.isfinite(value) for value in (x, y, foothold.place.yaw)):
            self.notice = "foothold ignored: not finite"
            return
        self._wanted, self.closes = (0.0, 0.0, 0.0), False
        self.notice = ""
        self.footholds.append(foothold)

    def insert(self, foothold: Foothold) -> None:
        """Insert a foothold before all others."""
        self.footholds.appendleft(foothold)

    def follow(self, plan: FootstepPlan) -> None:
        """Append all footholds of a plan."""
        for done, step in enumerate(plan.steps):
            other = plan.placements(done)[1 - step.foot]
            turned = _outwards(step.foot, step.goal.yaw - other.yaw)
            self.add_foothold(Foothold(step.foot, step.goal, checked=True, turned=turned))

    @property
    def moving(self) -> bool:
        """True while a step is commanded."""
        return bool(self.footholds) or any(self._followed) or any(self.velocity)

    @property
    def left(self) -> int | None:
        """Number of steps until the feet stay; None where that is open."""
        moves = self.closes or any(self._followed) or any(self.velocity)
        return None if moves else len(self.footholds) or None

    @property
    def _followed(self) -> Velocity:
        """Commanded velocity, as far as it is followed."""
        pace, (ahead, sideways, turn) = self.pace, self._wanted
        return pace * ahead, pace * sideways, pace * turn

    def advance(self, dt: float) -> None:
        """Rate-limit the velocity towards the command."""
        followed = self._followed
        if self.velocity == followed:
            return
        limits = self._limits
        rates = (max(limits.ahead, limits.back), limits.sideways, limits.turn)
        most = dt / limits.rise_time
        ahead, sideways, turn = (
            now + min(max(wanted - now, -most * rate), most * rate)
            for now, wanted, rate in zip(self.velocity, followed, rates, strict=True)
        )
        self.velocity = (ahead, sideways, turn)

    def first_foot(self) -> int:
        """First foot of a walk: the one on the side of the motion, or the left one."""
        if self.footholds:
            return self.footholds[0].foot
        _, sideways, turn = self._wanted
        return 1 if (sideways or turn) < 0.0 else 0

    def asks_for(self, foot: int) -> bool:
        """Return whether the next commanded foothold is one of that foot."""
        return bool(self.footholds) and self.footholds[0].foot == foot

    def next_foot(self, landed: int) -> int:
        """The next swing foot after a touchdown."""
        return self.footholds[0].foot if self.footholds else 1 - landed

    def steps(self, foot: int, stance: Placement, count: int) -> list[Placement]:
        """The next footholds, with alternating feet."""
        # Nothing changes from tick to tick while a foot is in the air and no command comes.
        asked = (foot, stance, count, self.velocity, self.closes, len(self.footholds))
        if asked != self._planned[0]:
            self._planned = asked, self._next(foot, stance, count)
        return self._planned[1]

    def _next(self, foot: int, stance: Placement, count: int) -> list[Placement]:
        steps: list[Placement] = []
        given = list(self.footholds)
        for i in range(count):
            if i < len(given) and given[i].foot == foot:
                place = self._allowed(stance, given[i])
            elif self.closes or i > 0:
                place = self._beside(foot, stance, (0.0, 0.0, 0.0) if given else self.velocity)
            else:
                place = self._beside(foot, stance, (0.0, 0.0, 0.0))
            steps.append(place)
            foot, stance = 1 - foot, place
        return steps

    def _beside(self, foot: int, stance: Placement, velocity: Velocity) -> Placement:
        """Return the foothold of a velocity."""
        ahead, sideways, turn = (self._time * speed for speed in velocity)
        out, room = side(foot), self._room
        turned = _share(turn * out, room.turn_in) * out
        wide = room.width + _share(sideways * out, room.width - room.near(turned))
        between = replace(stance, yaw=stance.yaw + 0.5 * turned)
        x, y = FootAxes(between, out).without((ahead, wide))
        return self._lying(foot, stance, (x, y, stance.yaw + turned))

    def _allowed(self, stance: Placement, asked: Foothold) -> Placement:
        """A foothold that was given, or the nearest that the legs and the other foot allow."""
        foot, place, checked, known = asked
        out, room = side(foot), self._room
        outwards = _outwards(foot, place.yaw - stance.yaw)
        # A plan may turn a foot farther: there the legs have been looked at.
        kept = min(max(outwards, -max(room.turn_in, -known)), max(room.turn, known))
        turned = out * kept
        axes = FootAxes(stance, out)
        wanted = axes.within(place.position[:2])
        x, y = room.bounds(turned, far=checked).nearest(wanted)
        moved, cut = math.dist((x, y), wanted), abs(outwards - kept)
        if moved >= LEVEL or cut >= _ASKEW:
            by = f"moved by {moved:.3f} m, turned by {cut:.2f} rad"
            self.notice = f"foothold out of reach: {by}"
        if moved >= LEVEL:
            px, py = axes.without((x, y))
        else:
            px, py, _ = place.position
            exact = Placement(position=(px, py, 0.0), yaw=stance.yaw + turned)
            height = self._ground.level_under(exact, self._room.sizes[foot])
            if self._ground.platforms and height is not None:
                return replace(exact, position=(px, py, height))
        return self._lying(foot, stance, (px, py, stance.yaw + turned))

    def _lying(self, foot: int, stance: Placement, place: tuple[float, float, float]) -> Placement:
        """A sole on the ground: as planned, or ahead or behind where an edge is under it."""
        x, y, yaw = place
        if not self._ground.platforms:
            (a, b), (x0, y0, z0) = stance.slope, stance.position
            z = z0 + a * (x - x0) + b * (y - y0)
            return Placement(position=(x, y, z), yaw=yaw, slope=stance.slope)
        found = level_place(place, self._room.sizes[foot], self._ground)
        if found is None:
            self.notice = f"no level ground near x = {x:.2f} m, y = {y:.2f} m"
            return Placement(position=(x, y, stance.position[2]), yaw=yaw)
        return found

    def carries(self, foot: int, place: Placement) -> bool:
        """Return whether all of a sole lies on ground as high as it."""
        if not self._ground.platforms:
            return True
        height = self._ground.level_under(place, self._room.sizes[foot])
        return height is not None and abs(height - place.position[2]) < LEVEL

    def _within_limits(self, asked: Velocity) -> Velocity:
        """The longest velocity in a direction that the limits and the legs allow."""
        limits, room = self._limits, self._room
        stride = 0.5 * room.ahead / self._time
        most = (
            min(limits.ahead if asked[0] > 0.0 else limits.back, 2.0 * stride),
            min(limits.sideways, 0.5 * (room.wide - room.near(0.0)) / self._time),
            min(limits.turn, 0.5 * (room.turn + room.turn_in) / self._time),
        )
        # Halved against overflow by numbers that no command means.
        halves = (0.5 * v / m if m > 0.0 else 0.0 for v, m in zip(asked, most, strict=True))
        size = 2.0 * math.hypot(*halves)
        ahead, sideways, turn = (
            v / max(size, 1.0) if m > 0.0 else 0.0 for v, m in zip(asked, most, strict=True)
        )
        return ahead, sideways, turn


def _share(outwards: float, inwards_most: float) -> float:
    """Return the share of one step in a way of two."""
    inwards = min(abs(outwards), max(inwards_most, 0.0))
    return 2.0 * outwards - inwards if outwards > 0.0 else -inwards


def _shown(velocity: Velocity) -> str:
    ahead, sideways, turn = velocity
    return f"({ahead:.2f} m/s, {sideways:.2f} m/s, {turn:.2f} rad/s)"
