"""Footholds: `Gait`, `Stride`, `FootstepPlan` and `plan_footsteps`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Annotated

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import Numbers, checked_kind
from poise._schema import Bounds, checked
from poise.errors import ConfigurationError
from poise.locomotion._pendulum import natural_frequency
from poise.locomotion._support import Point, SolePart, bearing, two_soles
from poise.locomotion._walking._ground import (
    CLEARANCE,
    Ground,
    Placement,
    clear_swing,
    wrapped,
    yaw_of,
)
from poise.robots import Robot
from poise.stack import checked_target

LARGEST = 10.0
"""No length, time or gain of a walk is larger, whatever its unit; most are far smaller."""

_SHORTEST_SWING = 0.1
"""A foot needs this long at least from lift-off to touchdown [s]."""

_NARROW = 0.6
"""Room between feet whose soles lean, over that of the feet as they stand."""


_Size = Annotated[float, Bounds(positive=True, most=LARGEST, unit="m")]
_Time = Annotated[float, Bounds(positive=True, most=LARGEST, unit="s")]
_Length = Annotated[float, Bounds(most=LARGEST, unit="m")]


@checked()
@dataclass(frozen=True, kw_only=True)
class Gait:
    """The timing and the shape of every step.

    Attributes:
        step_time: from one lift-off to the next [s].
        double_support: how long of it both feet stand [s].
        swing_height: how far a foot is lifted above the higher of its two ends [m].
        width: distance of the feet side by side [m]; as they stand when None.
        crouch: how far the centre of mass is lowered before the first step [m].
        shift_time: from the beginning to the first lift-off [s].
        settle_time: from the last touchdown to the end [s].
    """

    step_time: _Time = 0.7
    double_support: _Time = 0.15
    swing_height: _Size = 0.05
    width: _Size | None = None
    crouch: Annotated[float, Bounds(least=0.0, most=LARGEST, unit="m")] = 0.0
    shift_time: _Time = 1.0
    settle_time: _Time = 1.5

    def __post_init__(self) -> None:
        if self.step_time - self.double_support < _SHORTEST_SWING:
            raise ConfigurationError(
                "the gait leaves a foot no time to swing",
                got=f"step_time {self.step_time:g} s, double_support {self.double_support:g} s",
                wanted=f"{_SHORTEST_SWING:g} s or more between the two",
            )

    @property
    def swing_time(self) -> float:
        """From lift-off to touchdown [s]."""
        return self.step_time - self.double_support


_STEP_PHASE = 2.1
"""omega T of a step: as fast as people walk without hurry."""

_DOUBLE_SUPPORT = 0.12
"""Part of a step's time, by default."""

_CROUCH = 0.05
"""Descent of the CoM over its height, by default."""

_SWING_HEIGHT = 0.06
"""Lift of a foot over the height of the CoM, by default."""


def usual_gait(height: float) -> Gait:
    """Timing and shape of steps by the height of the CoM [m]."""
    crouch = _CROUCH * height
    step_time = _STEP_PHASE / natural_frequency(height - crouch)
    return Gait(
        step_time=step_time,
        double_support=_DOUBLE_SUPPORT * step_time,
        swing_height=_SWING_HEIGHT * height,
        crouch=crouch,
        shift_time=step_time,
        settle_time=step_time,
    )


@checked()
@dataclass(frozen=True, kw_only=True)
class Stride:
    """A number of steps of one kind.

    The body goes `length` ahead with every step. What it goes sideways and turns in two steps it
    does with the step of the foot on that side, so that the feet open first and close then, and
    are never nearer to each other than side by side.

    Attributes:
        steps: how many.
        length: ahead with each step [m]; backwards where negative.
        sideways: to the left, a step on average [m].
        turn: to the left, a step on average [rad].
    """

    steps: Annotated[int, Bounds(least=1.0, most=1e3, whole=True)]
    length: _Length = 0.0
    sideways: _Length = 0.0
    turn: Annotated[float, Bounds(most=LARGEST, unit="rad")] = 0.0


@dataclass(frozen=True, kw_only=True)
class Footstep:
    """One step."""

    foot: int  # which foot swings, 0 for the left, 1 for the right
    goal: Placement  # foothold


@dataclass(frozen=True, kw_only=True, eq=False)
class Stand:
    """Posture and soles of a robot before it walks."""

    soles: tuple[str, str]  # names of the left and of the right sole
    sizes: tuple[tuple[float, float], tuple[float, float]]  # length and width of each [m]
    start: tuple[Placement, Placement]  # where the soles are at the beginning
    q: Float64[np.ndarray, " nq"] = field(repr=False)  # configuration at the beginning
    com: tuple[float, float, float]  # centre of mass there [m]
    # where in each sole the ZMP can be while that foot alone carries the robot
    bearings: tuple[SolePart, SolePart]

    def zmp(self, foot: int, place: Placement) -> Point:
        """Return the rest of the ZMP on a foot that carries alone [m]."""
        return self.bearings[foot].rest_at(place.position[:2], place.yaw)

    def rest(self, places: Sequence[Placement]) -> Point:
        """Return the rest of the ZMP on both feet, evenly loaded [m]."""
        (ax, ay), (bx, by) = (self.zmp(foot, place) for foot, place in enumerate(places))
        return 0.5 * (ax + bx), 0.5 * (ay + by)

    @property
    def width(self) -> float:
        """Distance of the feet side by side in a walk [m]: as they stand at the beginning."""
        left, right = (p.position[:2] for p in self.start)
        apart = math.dist(left, right)
        if any(b.width > 0.0 for b in self.bearings):
            return apart
        touching = CLEARANCE + 0.5 * sum(width for _, width in self.sizes)
        return touching + _NARROW * (apart - touching)

    @property
    def middle(self) -> tuple[float, float, float]:
        """The middle of the feet at the beginning [m]."""
        left, right = (p.position for p in self.start)
        x, y, z = (0.5 * (a + b) for a, b in zip(left, right, strict=True))
        return x, y, z


_FLAT = 0.05
"""Soles tilted more than this do not stand on the ground [rad]."""


def stand_of(robot: Robot, q: Numbers | None = None) -> Stand:
    """Return how a robot stands in a posture, in its home one when None."""
    left, right = two_soles(robot)
    posture = robot.q_home if q is None else checked_target(q, robot.nq, "q of the walk")
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, posture)
    start: list[Placement] = []
    for name in (left, right):
        pose = data.oMf[robot.frame_id(name)]
        if math.acos(min(1.0, float(pose.rotation[2, 2]))) > _FLAT:
            raise ConfigurationError(
                f"{name} does not lie flat at the beginning of the walk",
                got=pose.rotation.round(3).tolist(),
                wanted="a robot that stands on its soles",
            )
        x, y, z = pose.translation.tolist()
        start.append(Placement(position=(x, y, z), yaw=yaw_of(pose.rotation)))
    x, y, z = pin.centerOfMass(model, data, posture).tolist()
    size_left, size_right = ((s.length, s.width) for s in (robot.soles[left], robot.soles[right]))
    # Headings are counted on from the left foot's, so that no difference is a whole turn.
    yaw = start[0].yaw + wrapped(start[1].yaw - start[0].yaw)
    return Stand(
        soles=(left, right),
        sizes=(size_left, size_right),
        start=(start[0], replace(start[1], yaw=yaw)),
        q=posture.copy(),
        com=(x, y, z),
        bearings=(bearing(robot, left, 1.0), bearing(robot, right, -1.0)),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class FootstepPlan(Stand):
    """A walk from one stand to the next.

    Made by `plan_footsteps` of strides, or by `from_footholds`. Times count from the beginning of
    the walk.

    Attributes:
        steps: in order; left and right take turns.
        gait: timing and shape.
        ground: what the robot walks on.
        clearance: least distance between the feet's edges, side by side [m].

    Raises:
        ConfigurationError: no step, two steps with one foot, or feet that would cross.
    """

    steps: tuple[Footstep, ...]
    gait: Gait = field(default_factory=Gait)
    ground: Ground = field(default_factory=Ground)
    clearance: float = CLEARANCE

    def __post_init__(self) -> None:
        if not self.steps:
            raise ConfigurationError("a plan without steps", got=0, wanted="one or more")
        for i, (before, after) in enumerate(pairwise(self.steps)):
            if before.foot == after.foot:
                raise ConfigurationError(
                    f"step {i + 2} of the plan is made with the foot of the step before",
                    got=self.soles[after.foot],
                    wanted="left and right in turns",
                )
        for i in range(len(self.steps) + 1):
            self._check_apart(i)

    @classmethod
    def from_footholds(
        cls,
        robot: Robot,
        footholds: Sequence[tuple[str, Numbers]],
        gait: Gait | None = None,
        *,
        q: Numbers | None = None,
        ground: Ground | None = None,
    ) -> "FootstepPlan":
        """The plan of a walk whose every foothold is known: of a planner, or of stepping stones.

        Args:
            robot: on two soles.
            footholds: for each step the name of its sole, and where that comes down: x, y [m] and
                heading [rad] in the world. The height is that of the ground.
            gait: timing and shape of the steps; its width is that of what is asked for after them.
            q: how the robot stands, in its home posture when None.
            ground: what it walks on; a floor as high as its soles when None.

        Raises:
            ConfigurationError: a robot that does not stand on two soles, no step, a sole that is
                none, two steps with one foot, feet that would cross, a foothold across an edge, or
                a swing that would knock against a platform.
        """
        gait = gait or Gait()
        stand = stand_of(robot, q)
        soles, sizes, start = stand.soles, stand.sizes, stand.start
        ground = ground or level_floor(start)
        steps: list[Footstep] = []
        feet = list(start)
        for i, (sole, place) in enumerate(footholds, 1):
            if sole not in soles:
                raise ConfigurationError(
                    f"step {i} of the plan is made with no sole of the robot",
                    got=sole,
                    choices=soles,
                )
            foot = soles.index(sole)
            before, size = feet[foot], sizes[foot]
            x, y, yaw = checked_target(place, 3, f"foothold {i} of the plan").tolist()
            # A heading is the same a whole turn on; the foot goes the shorter way.
            yaw += 2.0 * math.pi * round((before.yaw - yaw) / (2.0 * math.pi))
            level = ground.level_under(Placement(position=(x, y, 0.0), yaw=yaw), size)
            if level is None:
                raise ConfigurationError(
                    f"the foothold at x = {x:.3f} m, y = {y:.3f} m does not carry the whole sole",
                    got="an edge under it",
                    wanted="one height under the sole",
                )
            goal = Placement(position=(x, y, level), yaw=yaw)
            height = gait.swing_height
            if ground.platforms and not clear_swing(before, goal, size, height, ground):
                raise ConfigurationError(
                    f"step {i} of the walk would knock against a platform",
                    got=f"swing_height {height:g} m",
                    wanted="a higher swing, or other steps",
                )
            steps.append(Footstep(foot=foot, goal=goal))
            feet[foot] = goal
        return cls(**vars(stand), steps=tuple(steps), gait=gait, ground=ground)

    def _check_apart(self, done: int) -> None:
        left, right = self.placements(done)
        yaw = 0.5 * (left.yaw + right.yaw)
        dx = left.position[0] - right.position[0]
        dy = left.position[1] - right.position[1]
        apart = -math.sin(yaw) * dx + math.cos(yaw) * dy
        needed = self.clearance + beside(self.sizes, left.yaw - right.yaw)
        finite = all(map(math.isfinite, (*left.position, left.yaw, *right.position, right.yaw)))
        if not (finite and apart >= needed):
            raise ConfigurationError(
                f"step {done} of the plan brings the feet together or across each other",
                got=f"{apart:.3f} m from the right sole's centre to the left one's",
                wanted=f"{needed:.3f} m or more",
            )

    @property
    def count(self) -> int:
        """Number of steps."""
        return len(self.steps)

    def placements(self, done: int) -> tuple[Placement, Placement]:
        """Return the placements of the left and the right sole after so many steps."""
        feet = list(self.start)
        for step in self.steps[max(0, done - 2) : done]:
            feet[step.foot] = step.goal
        return feet[0], feet[1]

    def lift_off(self, step: int) -> float:
        """Start time of a step, counted from zero [s]."""
        return self.gait.shift_time + step * self.gait.step_time

    def touchdown(self, step: int) -> float:
        """Planned end time of a step [s]."""
        return self.lift_off(step) + self.gait.swing_time

    @property
    def duration(self) -> float:
        """Duration of the whole walk [s]."""
        return self.touchdown(self.count - 1) + self.gait.settle_time


def beside(sizes: Sequence[Point], yaw: float) -> float:
    """Return the distance of the centres of two soles that touch, turned against each other [m]."""
    # A turned sole takes more room to its side.
    c, s = math.cos(0.5 * yaw), abs(math.sin(0.5 * yaw))
    return sum(0.5 * (width * c + length * s) for length, width in sizes)


def level_floor(start: tuple[Placement, Placement]) -> Ground:
    """A floor as high as the soles that stand on it."""
    return Ground(height=0.5 * sum(p.position[2] for p in start))


_EDGE = 0.015
"""Distance of a sole from the edge of a platform [m]."""

_SEARCH, _FARTHEST = 0.005, 0.25
"""Resolution of the search for a place with nothing but one height under it, and its end [m]."""


def plan_footsteps(
    robot: Robot,
    strides: Sequence[Stride],
    gait: Gait | None = None,
    *,
    q: Numbers | None = None,
    ground: Ground | None = None,
) -> FootstepPlan:
    """The steps of a walk from where the robot stands.

    A foothold that would lie across the edge of a platform moves ahead or back to the nearest
    place that carries the whole sole. After the last stride the feet close.

    Args:
        robot: on two soles.
        strides: one after the other.
        gait: timing and shape of the steps.
        q: how the robot stands, in its home posture when None.
        ground: what it walks on; a floor as high as its soles when None.

    Returns:
        The plan, with one step more than the strides have where the feet have to close.

    Raises:
        ConfigurationError: a robot that does not stand on two soles, no stride, feet that cross,
            or no place for a foot.
    """
    gait = gait or Gait()
    for stride in strides:
        checked_kind(stride, Stride, "a stride of the walk")
    if not strides:
        raise ConfigurationError("a walk without strides", got=0, wanted="one or more")
    stand = stand_of(robot, q)
    soles, sizes, start = stand.soles, stand.sizes, stand.start
    ground = ground or level_floor(start)
    width = gait.width if gait.width is not None else stand.width
    footholds: list[tuple[str, Numbers]] = []
    for i, (foot, (x, y, yaw)) in enumerate(_body_path(start, strides), 1):
        out = (0.5 - foot) * width
        x, y = x - out * math.sin(yaw), y + out * math.cos(yaw)
        found = level_place((x, y, yaw), sizes[foot], ground)
        if found is None:
            raise ConfigurationError(
                f"step {i} of the walk finds no place that carries the whole sole",
                got=f"x = {x:.3f} m, y = {y:.3f} m",
                wanted=f"one height under the sole within {_FARTHEST:g} m ahead or behind",
            )
        footholds.append((soles[foot], (*found.position[:2], yaw)))
    return FootstepPlan.from_footholds(robot, footholds, gait, q=stand.q, ground=ground)


def _body_path(
    start: tuple[Placement, Placement], strides: Sequence[Stride]
) -> list[tuple[int, tuple[float, float, float]]]:
    """For each step its foot, and the body's middle after it: x, y, heading."""
    left, right = start
    x, y = (0.5 * (left.position[k] + right.position[k]) for k in (0, 1))
    yaw = 0.5 * (left.yaw + right.yaw)
    first = next((s.sideways or s.turn for s in strides if s.sideways or s.turn), 0.0)
    foot = 1 if first < 0.0 else 0
    bodies: list[tuple[int, tuple[float, float, float]]] = []
    for stride in strides:
        for _ in range(stride.steps):
            out = 1 - 2 * foot
            side, turn = (out * max(out * way, 0.0) for way in (stride.sideways, stride.turn))
            middle = yaw + turn
            x += stride.length * math.cos(middle) - 2.0 * side * math.sin(middle)
            y += stride.length * math.sin(middle) + 2.0 * side * math.cos(middle)
            yaw += 2.0 * turn
            bodies.append((foot, (x, y, yaw)))
            foot = 1 - foot
    bodies.append((foot, (x, y, yaw)))
    return bodies


def level_place(
    place: tuple[float, float, float], size: tuple[float, float], ground: Ground
) -> Placement | None:
    """A sole on the ground where it should lie, or at the nearest place ahead or behind."""
    x, y, yaw = place
    grown = (size[0] + 2.0 * _EDGE, size[1] + 2.0 * _EDGE)
    for i in range(2 * int(_FARTHEST / _SEARCH) + 1):
        # 0, 1, -1, 2, -2, ... times the resolution
        shift = _SEARCH * ((i + 1) // 2) * (1 if i % 2 else -1)
        tried = (x + shift * math.cos(yaw), y + shift * math.sin(yaw))
        height = ground.level_under(Placement(position=(*tried, 0.0), yaw=yaw), grown)
        if height is not None:
            return Placement(position=(*tried, height), yaw=yaw)
    return None
