"""`SelfCollisionLimit`: no task takes a link of the robot into another one."""

from collections.abc import Collection, Sequence
from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Bool, Float64, Int64

from poise._checks import checked_kind, checked_number
from poise._compiled import part
from poise.dynamics import KINEMATICS, ROTATION, VELOCITY, StateNumbers, place_frame, turn_to_world
from poise.robots import Robot, capsules_of
from poise.stack._bound_once import Limit
from poise.stack._contact import Contact
from poise.stack._joint_limit import largest_acceleration
from poise.stack._owner import Owner
from poise.stack._points import (
    TOUCHING,
    Vector,
    clear,
    cross,
    distance_motion,
    dot,
    plus,
    vector,
    velocity_of,
    write_distance,
)
from poise.stack._tables import Line, Rows, StackNumbers

_NEVER = -10.0
"""Least distance of links that have no bound: none overlap as far [m]."""

_ROOM_AT_HOME = 0.01
"""Distance by which links that stand near each other at home may come nearer [m]."""

PAIRS = 10
"""Rows: pairs of capsules that are looked after at a time."""

_NEAR = 0.5
"""Pairs farther apart than this have no row [m]."""

_AHEAD = 0.16
"""Time in which those pairs that have rows will be nearest [s]."""

_HARDEST = 30.0
"""Largest bound of the acceleration of a distance [m/s^2]."""

_SHORT = TOUCHING * TOUCHING
"""Square of the length of an axis that is a point [m^2]."""


class _Settings(NamedTuple):
    """First parameters of the limit."""

    braking: float  # [m/s^2]
    horizon: float  # [s]
    approach_time: float  # [s]


SHAPES, SHAPE = len(_Settings._fields), 7
"""Place of the first capsule in the limit's parameters, and how many numbers each has: both ends of
the axis and the radius [m]. The least distance of each pair follows [m]."""

_HALF, _SPEED, _PLACED, _CHOSEN_PAIR = 9, 10, 11, 6
"""Numbers a capsule of the work space: both ends of its axis in the world, its middle, half its
length, the largest speed of its points; numbers a row: pair, place on either axis, distance of the
axes, its rate, and what the pair is ranked by."""

_Use = tuple[frozenset[Contact], frozenset[str] | None]
"""Configuration of the rows: active contacts, and the joints that may move, None for all."""


class NearPair(NamedTuple):
    """Two links that are near each other.

    Attributes:
        links: their names, as the document has them.
        distance: of their capsules, negative where they overlap [m].
    """

    links: tuple[str, str]
    distance: float


class SelfCollisionLimit(Limit):
    """Bounds that keep arms, legs, trunk and head apart, whatever the tasks.

    Links are capsules (`LinkCapsules`). With x_a and x_b the nearest points of the axes of two, n
    the unit vector from x_b to x_a and r their radii, their distance d moves by

        d      = |x_a - x_b| - r_a - r_b
        d_dot  = n (J_a - J_b) v
        d_ddot = n (J_a - J_b) dv + drift

    where the drift has the points' own accelerations, their motion across n, and that they slide
    along the axes. d may not shrink so fast that braking at b could not stop it at `margin` any
    more: the viability bound that `JointLimit` has for joints,

        -d_ddot <= a(d - margin, -d_dot)

    Where velocities are commanded, d_dot >= (margin - d) / approach_time. Links that stand near
    each other at home may come 1 cm nearer than there.

    Legs that both stand, and what else only joints between contacts and base move, are left out:
    they go where the body goes, whose balance is worth more. The rows stand in the level of the
    balance limit, below contacts and joint limits and above all tasks, and are missed by as little
    as can be where those leave no room. In every tick the pairs have them that would be nearest in
    a sixth of a second; there are always as many rows, and those of pairs that are far apart are
    empty.

    Its settings are read-only: construct a new controller for another limit.

    Args:
        enabled: False takes the limit away; nothing is computed then.
        legs_only: True keeps legs off each other and nothing else, where no task moves the arms out
            of their way.
        margin: distance that is kept [m].
        braking: deceleration with which links plan to stop before they touch [m/s^2].
        horizon: of the bounds, as that of the joints' [s].
        approach_time: in which links may at most come as near as they may, where velocities are
            commanded [s].

    Attributes:
        name: what reports call it.
        enabled: True where the limit has rows.
        margin: distance that is kept [m].
    """

    foreign = ("_made",)
    enabled: bool
    margin: float

    def __init__(
        self,
        *,
        enabled: bool = True,
        legs_only: bool = False,
        margin: float = 0.02,
        braking: float = 5.0,
        horizon: float = 0.03,
        approach_time: float = 0.1,
    ) -> None:
        name = "self-collision limit"
        self._legs_only = checked_kind(legs_only, bool, f"legs_only of the {name}")
        self._settings = _Settings(
            checked_number(braking, f"braking of the {name} [m/s^2]", above=0.0),
            checked_number(horizon, f"horizon of the {name} [s]", above=0.0),
            checked_number(approach_time, f"approach_time of the {name} [s]", above=0.0),
        )
        self._set(
            name=name,
            enabled=checked_kind(enabled, bool, f"enabled of the {name}"),
            margin=checked_number(margin, f"margin of the {name} [m]"),
        )
        self._legs_pass, self._at_rest = False, False
        self.share_memory()

    def share_memory(self) -> None:
        """Begin without rows, which refer to the contacts that they were made for."""
        self._made: dict[_Use, SelfCollisionRows] = {}

    @property
    def near(self) -> tuple[NearPair, ...]:
        """The pairs that had rows at the last tick, nearest first."""
        seen = frozenset[Contact]().union(*(contacts for contacts, _ in self._made))
        active = frozenset(c for c in seen if c.active)
        used = [rows for (contacts, _), rows in self._made.items() if contacts == active]
        return used[-1].near() if used else ()

    def let_legs_pass(self, legs_pass: bool) -> None:
        """Leave legs to balance for a while, or keeps them apart again.

        A step that catches the robot comes down beside the other foot, nearer than capsules, which
        are larger than links, can be: its planner keeps the feet apart.

        Args:
            legs_pass: whether pairs of a leg and a leg have no bound.
        """
        if legs_pass != self._legs_pass:
            self._legs_pass = legs_pass
            self._tell_rows()

    def rest(self, at_rest: bool) -> None:
        """Suspend all bounds, or restore them.

        Where velocities are commanded a foot may stand that is no contact of the stack: links that
        only it could keep apart go where the body goes.

        Args:
            at_rest: whether no pair has a bound.
        """
        if at_rest != self._at_rest:
            self._at_rest = at_rest
            self._tell_rows()

    def _tell_rows(self) -> None:
        for rows in self._made.values():
            rows.let_pass(legs=self._legs_pass, everything=self._at_rest)

    def bind(self, robot: Robot) -> None:
        """Find the capsules of a robot; controllers call it before the first tick.

        Raises:
            ConfigurationError: the limit serves another robot.
        """
        if self.enabled:
            super().bind(robot)

    def _bind(self, robot: Robot) -> None:
        self._capsules = capsules = capsules_of(robot)
        joints, self._places = np.unique(capsules.joints, return_inverse=True)
        names, kind = robot.model.names, pin.FrameType.JOINT
        self._frames = tuple(
            int(robot.model.getFrameId(names[j], kind)) if j > 0 else 0 for j in joints.tolist()
        )
        shapes = np.column_stack([capsules.starts, capsules.ends, capsules.radii])
        self._shapes = np.concatenate([self._settings, shapes.ravel()])
        self._margins = np.minimum(self.margin, capsules.at_home - _ROOM_AT_HOME)

    def rows_for(
        self, contacts: Sequence[Contact], joints: Collection[str] | None = None
    ) -> "SelfCollisionRows | None":
        """The rows for a set of active contacts; None where nothing can touch.

        Args:
            contacts: bound to the robot that the limit serves.
            joints: names of those that may move; all when None.
        """
        if not self.enabled or self._robot is None:
            return None
        use = frozenset(contacts), None if joints is None else frozenset(joints)
        if use not in self._made:
            free, legs = self._free_pairs(self._robot, *use), self._of_legs(self._robot)
            if self._legs_only:
                free &= legs
            if not free.any():
                return None
            pairs, places = self._capsules.pairs[free], self._places
            table = [len(places), len(pairs), *places.tolist(), *pairs.ravel().tolist()]
            names = self._capsules.names
            links = [(names[i], names[j]) for i, j in pairs.tolist()]
            parameters = np.append(self._shapes, self._margins[free])
            rows = SelfCollisionRows(self.name, parameters, self._frames, table, links, legs[free])
            rows.let_pass(legs=self._legs_pass, everything=self._at_rest)
            self._made[use] = rows
        return self._made[use]

    def _of_legs(self, robot: Robot) -> Bool[np.ndarray, " pairs"]:
        """Pairs of a leg and a leg."""
        legs = [joint for sole in robot.soles for joint in robot.leg_joints(sole)]
        joints = self._capsules.joints[self._capsules.pairs]
        return np.logical_and.reduce(np.isin(joints, legs), axis=1)

    def _free_pairs(
        self, robot: Robot, contacts: frozenset[Contact], names: frozenset[str] | None
    ) -> Bool[np.ndarray, " pairs"]:
        """Pairs that some joint moves which may and stands between no contact and the base."""
        supports = robot.model.supports
        stand = set[int]().union(*(robot.joints_above(c.frame) for c in contacts))
        if names is not None:
            stand |= {j for j, name in enumerate(robot.model.names) if name not in names}
        joints = self._capsules.joints[self._capsules.pairs]
        between = [set(supports[i]) ^ set(supports[j]) for i, j in joints.tolist()]
        return np.array([bool(moving - stand) for moving in between], dtype=np.bool_)


class SelfCollisionRows(Owner):
    """The rows of a self-collision limit for a set of active contacts.

    Attributes:
        name: what reports call them.
        labels: names of the rows.
    """

    def __init__(
        self,
        name: str,
        parameters: Float64[np.ndarray, " p"],
        frames: tuple[int, ...],
        table: list[int],
        links: list[tuple[str, str]],
        legs: Bool[np.ndarray, " pairs"],
    ) -> None:
        self.name, self.parameters, self._links = name, parameters, links
        self._margins = parameters[len(parameters) - len(links) :]
        self._least, self._legs = self._margins.copy(), legs
        self.dim, self.labels = PAIRS, [(f"{name}: near links", PAIRS)]
        self.frame_ids, self.chosen = frames, np.array(table, dtype=np.int64)
        self.room = KINEMATICS * len(frames) + _PLACED * table[0] + _CHOSEN_PAIR * PAIRS
        self._distances, self._pairs = np.full(PAIRS, np.inf), np.zeros(PAIRS)

    def view(self, rows: Rows, own: slice, nv: int) -> None:
        """Take views of its rows as its attributes."""
        super().view(rows, own, nv)
        self._distances, self._pairs = rows.error[own], rows.error_rate[own]

    def let_pass(self, *, legs: bool, everything: bool) -> None:
        """Which pairs have no bound for a while."""
        self._margins[:] = np.where((self._legs & legs) | everything, _NEVER, self._least)

    def rooms(self) -> list[float]:
        """Return the room above the least distance of each row's pair [m]; inf without one."""
        return [
            distance - float(self._margins[int(pair)]) if isfinite(distance) else inf
            for pair, distance in zip(self._pairs.tolist(), self._distances.tolist(), strict=True)
        ]

    def near(self) -> tuple[NearPair, ...]:
        """The pairs that have rows, nearest first."""
        found = zip(self._pairs.tolist(), self._distances.tolist(), strict=True)
        near = [NearPair(self._links[int(pair)], d) for pair, d in found if isfinite(d)]
        return tuple(sorted(near, key=lambda pair: pair.distance))


@part
def bound_self_collision(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """Rows for the distances of the pairs that are about to be nearest."""
    motion, owners, work = state.motion, assembly.owners, assembly.work
    clear(assembly, line.first, PAIRS, len(motion.columns))
    table = owners.chosen[line.chosen :]
    capsules, last = int(table[0]), 0
    for i in range(capsules):
        last = max(last, int(table[2 + i]))
    for i in range(last + 1):
        place_frame(motion, owners.frames, line.frame + i, work, i * KINEMATICS)
        turn_to_world(work, i * KINEMATICS)
    placed = (last + 1) * KINEMATICS
    chosen = placed + _PLACED * capsules
    _place_capsules(owners.parameters, line.start, table, work, placed)
    count = _choose(owners.parameters, line.start, table, work, placed, chosen)
    taken = 0
    for at in range(chosen, chosen + count * _CHOSEN_PAIR, _CHOSEN_PAIR):
        # A pair has its own row, as long as no other has it: what is active stays so.
        slot = int(work[at]) % PAIRS
        while (taken >> slot) & 1:
            slot = (slot + 1) % PAIRS
        taken |= 1 << slot
        _write(state, assembly, line, line.first + slot, placed, at)


@part
def _place_capsules(
    parameters: Float64[np.ndarray, " p"],
    start: int,
    table: Int64[np.ndarray, " t"],
    work: Float64[np.ndarray, " work"],
    placed: int,
) -> None:
    """Axes of all capsules in the world, with bounds on the motion of their points."""
    for i in range(table[0]):
        frame, shape = int(table[2 + i]) * KINEMATICS, start + SHAPES + SHAPE * i
        a, fastest = placed + _PLACED * i, 0.0
        for side in range(2):
            end = vector(parameters, shape + 3 * side)
            for k in range(3):
                turned = dot(vector(work, frame + ROTATION + 3 * k), end)
                work[a + 3 * side + k] = work[frame + k] + turned
            # Speed is convex along the axis.
            speed = velocity_of(work, frame, vector(work, a + 3 * side))
            fastest = max(fastest, dot(speed, speed))
        axis = _axis(work, a)
        for k in range(3):
            work[a + 6 + k] = 0.5 * (work[a + k] + work[a + 3 + k])
        work[a + _HALF], work[a + _SPEED] = 0.5 * sqrt(dot(axis, axis)), sqrt(fastest)


@part
def _axis(work: Float64[np.ndarray, " work"], a: int) -> Vector:
    """The vector from one end of an axis to the other."""
    return plus(vector(work, a + 3), vector(work, a), -1.0)


@part
def _point(work: Float64[np.ndarray, " work"], a: int, place: float) -> Vector:
    """A point of an axis, from 0 to 1."""
    return plus(vector(work, a), _axis(work, a), place)


@part
def _choose(
    parameters: Float64[np.ndarray, " p"],
    start: int,
    table: Int64[np.ndarray, " t"],
    work: Float64[np.ndarray, " work"],
    placed: int,
    chosen: int,
) -> int:
    """Find the pairs that will be nearest; returns how many there are.

    A pair is left out as soon as its middles are farther apart than one that would count.
    """
    capsules, pairs = int(table[0]), int(table[1])
    shapes = start + SHAPES
    count, margins = 0, shapes + SHAPE * capsules
    last, most = 0, np.inf
    for pair in range(pairs):
        i, j = int(table[2 + capsules + 2 * pair]), int(table[3 + capsules + 2 * pair])
        a, b = placed + _PLACED * i, placed + _PLACED * j
        radii = parameters[shapes + SHAPE * i + 6] + parameters[shapes + SHAPE * j + 6]
        least = parameters[margins + pair]
        speed = work[a + _SPEED] + work[b + _SPEED]
        within = radii + work[a + _HALF] + work[b + _HALF]
        within += min(_NEAR, most + least + _AHEAD * speed)
        apart = plus(vector(work, a + 6), vector(work, b + 6), -1.0)
        if within <= 0.0 or dot(apart, apart) > within * within:
            continue
        s, t = _nearest_places(work, a, b)
        p, q = _point(work, a, s), _point(work, b, t)
        apart = plus(p, q, -1.0)
        distance = sqrt(dot(apart, apart))
        if distance - radii > _NEAR or distance < TOUCHING:
            continue
        one = velocity_of(work, int(table[2 + i]) * KINEMATICS, p)
        other = velocity_of(work, int(table[2 + j]) * KINEMATICS, q)
        rate = dot(apart, plus(one, other, -1.0)) / distance
        # Ranked by the room above the least distance of each.
        left = distance - radii - least + _AHEAD * min(rate, 0.0)
        place = count
        if count == PAIRS:
            place = last
            if left >= most:
                continue
        else:
            count += 1
        at = chosen + place * _CHOSEN_PAIR
        work[at], work[at + 1], work[at + 2] = float(pair), s, t
        work[at + 3], work[at + 4], work[at + 5] = distance, rate, left
        if count == PAIRS:
            last, most = 0, work[chosen + 5]
            for k in range(1, PAIRS):
                if work[chosen + k * _CHOSEN_PAIR + 5] > most:
                    last, most = k, work[chosen + k * _CHOSEN_PAIR + 5]
    return count


@part
def _nearest_places(work: Float64[np.ndarray, " work"], a: int, b: int) -> tuple[float, float]:
    """Places of the nearest points of two axes, from 0 to 1 (Ericson 2005, 5.1.9)."""
    u, v = _axis(work, a), _axis(work, b)
    w = plus(vector(work, a), vector(work, b), -1.0)
    aa, bb, ab, aw, bw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    s, det = 0.0, aa * bb - ab * ab
    # Of parallel axes any place will do.
    if det > 1e-9 * aa * bb:
        s = min(max((ab * bw - bb * aw) / det, 0.0), 1.0)
    t = (ab * s + bw) / bb if bb > _SHORT else 0.0
    if bb <= _SHORT or t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((ab * t - aw) / aa, 0.0), 1.0) if aa > _SHORT else 0.0
    return s, t


@part
def _write(
    state: StateNumbers, assembly: StackNumbers, line: Line, row: int, placed: int, at: int
) -> None:
    """The row of a pair that was chosen."""
    owners, rows, work = assembly.owners, assembly.rows, assembly.work
    parameters, start, table = owners.parameters, line.start, owners.chosen[line.chosen :]
    capsules, pair = int(table[0]), int(work[at])
    i, j = int(table[2 + capsules + 2 * pair]), int(table[3 + capsules + 2 * pair])
    axes, places = (placed + _PLACED * i, placed + _PLACED * j), (work[at + 1], work[at + 2])
    one, other = int(table[2 + i]), int(table[2 + j])
    frames = (one * KINEMATICS, other * KINEMATICS)
    points = (_point(work, axes[0], places[0]), _point(work, axes[1], places[1]))
    length, n, slip, rate, drift = distance_motion(work, frames, points)
    shapes = start + SHAPES
    distance = length - parameters[shapes + SHAPE * i + 6] - parameters[shapes + SHAPE * j + 6]
    room = distance - parameters[shapes + SHAPE * capsules + pair]
    rows.error[row], rows.error_rate[row] = distance, float(pair)
    asked = _Settings(parameters[start], parameters[start + 1], parameters[start + 2])
    if assembly.velocities:
        rows.target[row] = rows.reference[row] = -room / asked.approach_time
        rows.drift[row] = 0.0
    else:
        horizon = asked.horizon
        sliding = _sliding(work, axes, places, frames, n, slip, length)
        # Within the horizon no distance shrinks faster than the points themselves move.
        drift -= min(sliding, sqrt(dot(slip, slip)) / horizon)
        settings = (_HARDEST, horizon, asked.braking)
        reference = -largest_acceleration(room, -rate, np.inf, settings)
        rows.target[row], rows.drift[row] = reference - drift, drift
        rows.reference[row] = reference
    write_distance(state, assembly, row, (line.frame + one, line.frame + other), points, n)


@part
def _sliding(
    work: Float64[np.ndarray, " work"],
    axes: tuple[int, int],
    places: tuple[float, float],
    frames: tuple[int, int],
    n: Vector,
    slip: Vector,
    length: float,
) -> float:
    """Part of a distance's second derivative by which nearest points slide along their axes.

    With g = |x_a(s) - x_b(t)|^2 / 2 over the places s and t on the axes, whose nearest points they
    are, the rate of g is its partial one, and the rate of that

        g_ddot = g_tt - g_tp^T g_pp^-1 g_tp,        p the places that are inside their axes.
    """
    u, v = _axis(work, axes[0]), _axis(work, axes[1])
    aa, bb, ab = dot(u, u), dot(v, v), dot(u, v)
    # Rates of (x_a - x_b) u and of (x_b - x_a) v.
    turned = cross(vector(work, frames[0] + VELOCITY + 3), u)
    as_ = dot(slip, u) + length * dot(n, turned)
    turned = cross(vector(work, frames[1] + VELOCITY + 3), v)
    bs = -dot(slip, v) - length * dot(n, turned)
    free_a, free_b = 0.0 < places[0] < 1.0 and aa > _SHORT, 0.0 < places[1] < 1.0 and bb > _SHORT
    slide = 0.0
    if free_a and free_b:
        # The inverse of [[aa, -ab], [-ab, bb]]; parallel axes have no nearest points to follow.
        det = max(aa * bb - ab * ab, 1e-6 * aa * bb)
        slide = (bb * as_ * as_ + 2.0 * ab * as_ * bs + aa * bs * bs) / det
    elif free_a:
        slide = as_ * as_ / aa
    elif free_b:
        slide = bs * bs / bb
    return slide / length
