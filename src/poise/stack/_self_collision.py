"""`SelfCollisionLimit`: no task takes a link of the robot into another one.

`SelfCollisionRows`: its rows.
"""

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Bool, Float64

from poise._checks import checked_kind, checked_number
from poise._copies import Copied
from poise.errors import ConfigurationError
from poise.robots import Robot, capsules_of
from poise.stack._contact import Contact
from poise.stack._owner import Owner
from poise.stack._self_collision_kernels import PAIRS, room_for
from poise.stack._tables import Kind, Rows

_NOTHING = np.inf
"""Distance that a row without a pair reports [m]."""


_NEVER = -10.0
"""Least distance of links that have no bound: none overlap as far [m]."""

_ROOM_AT_HOME = 0.01
"""How much nearer than at home links may come that stand near each other there [m]."""

_Use = tuple[frozenset[Contact], frozenset[str] | None]
"""What rows are for: active contacts, and the joints that may move, None for all."""


class NearPair(NamedTuple):
    """Two links that are near each other.

    Attributes:
        links: their names, as the document has them.
        distance: of their capsules, negative where they overlap [m].
    """

    links: tuple[str, str]
    distance: float


class SelfCollisionLimit(Copied):
    """Bounds that keep arms, legs, trunk and head apart, whatever tasks ask for.

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

    What it is made of is for reading: another limit makes another controller.

    Args:
        enabled: False takes the limit away; nothing is computed then.
        legs_only: True keeps legs off each other and nothing else, where nobody moves the arms out
            of their way.
        margin: distance that is kept [m].
        braking: deceleration with which links plan to stop before they touch [m/s^2].
        horizon: of the bounds, as that of the joints' [s].
        approach_time: in which links may at most come as near as they may, where velocities are
            commanded [s].

    Attributes:
        name: what reports call it.
    """

    foreign = ("_made",)

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
        self.name = name = "self-collision limit"
        self._enabled = checked_kind(enabled, bool, f"enabled of the {name}")
        self._legs_only = checked_kind(legs_only, bool, f"legs_only of the {name}")
        self._margin = checked_number(margin, f"margin of the {name} [m]")
        self._braking = checked_number(braking, f"braking of the {name} [m/s^2]", above=0.0)
        self._horizon = checked_number(horizon, f"horizon of the {name} [s]", above=0.0)
        self._approach = checked_number(
            approach_time, f"approach_time of the {name} [s]", above=0.0
        )
        self._robot: Robot | None = None
        self._legs_pass, self._at_rest = False, False
        self.share_memory()

    def share_memory(self) -> None:
        """Begin without rows, which refer to the contacts that they were made for."""
        self._made: dict[_Use, SelfCollisionRows] = {}

    @property
    def enabled(self) -> bool:
        """True where the limit has rows."""
        return self._enabled

    @property
    def margin(self) -> float:
        """Distance that is kept [m]."""
        return self._margin

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
        are larger than links, can be: whoever makes it keeps the feet apart.

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
        if self._robot is robot or not self._enabled:
            return
        if self._robot is not None:
            raise ConfigurationError(
                "the self-collision limit already serves another robot",
                got=robot.name,
                wanted=f"robot {self._robot.name!r}, or a limit of its own",
            )
        self._robot, self._capsules = robot, capsules_of(robot)
        capsules = self._capsules
        joints, self._places = np.unique(capsules.joints, return_inverse=True)
        self._frames = tuple(_frame_of(robot, int(joint)) for joint in joints)
        shapes = np.column_stack([capsules.starts, capsules.ends, capsules.radii])
        settings = [self._braking, self._horizon, self._approach]
        margins = np.minimum(self._margin, capsules.at_home - _ROOM_AT_HOME)
        self._parameters = np.concatenate([settings, shapes.ravel(), margins])
        self._shapes = np.concatenate([settings, shapes.ravel()])
        self._margins = margins

    def rows_for(
        self, contacts: Sequence[Contact], joints: Collection[str] | None = None
    ) -> "SelfCollisionRows | None":
        """The rows for a set of active contacts; None where nothing can touch.

        Args:
            contacts: bound to the robot that the limit serves.
            joints: names of those that may move; all when None.
        """
        if not self._enabled or self._robot is None:
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
            names = [self._capsules.names[i] for i in pairs.ravel()]
            links = list(zip(names[::2], names[1::2], strict=True))
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


def _frame_of(robot: Robot, joint: int) -> int:
    if joint == 0:
        return 0
    return int(robot.model.getFrameId(robot.model.names[joint], pin.FrameType.JOINT))


class SelfCollisionRows(Owner):
    """The rows of a self-collision limit for a set of active contacts.

    Attributes:
        name: what reports call them.
        labels: names of the rows.
    """

    kind = Kind.SELF_COLLISION

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
        self.room = room_for(len(self.frame_ids), int(self.chosen[0]))
        self._distances = np.full(PAIRS, _NOTHING)
        self._pairs = np.zeros(PAIRS)

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
            distance - float(self._margins[int(pair)]) if math.isfinite(distance) else math.inf
            for pair, distance in zip(self._pairs.tolist(), self._distances.tolist(), strict=True)
        ]

    def near(self) -> tuple[NearPair, ...]:
        """The pairs that have rows, nearest first."""
        near = [
            NearPair(self._links[int(pair)], float(distance))
            for pair, distance in zip(self._pairs, self._distances, strict=True)
            if np.isfinite(distance)
        ]
        return tuple(sorted(near, key=lambda pair: pair.distance))
