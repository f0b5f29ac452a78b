"""`Description`: the facts about a robot that its URDF or MJCF does not hold."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, WrapValidator

from poise._schema import (
    NOT_IN_FILES,
    NotNegative,
    Number,
    Point,
    Positive,
    Text,
    Vector,
    checked,
    locate,
    read,
)
from poise.errors import RobotError

T = TypeVar("T")


@checked(RobotError)
@dataclass(frozen=True, kw_only=True)
class Mount:
    """Placement of a frame on a link."""

    link: Text  # the link
    # origin of the frame in the link [m]
    position: Point = field(default_factory=lambda: np.zeros(3))
    # roll, pitch, yaw of the frame in the link, as in URDF [rad]
    rpy: Point = field(default_factory=lambda: np.zeros(3))


@checked(RobotError)
@dataclass(frozen=True, kw_only=True)
class SoleMount(Mount):
    """A sole: its centre, x forward and z up, with its size."""

    length: Positive  # along x [m]
    width: Positive  # along y [m]


def _check_span(span: tuple[float, float]) -> tuple[float, float]:
    if span[0] >= span[1]:
        raise RobotError("limits cross", got=list(span), wanted="[lower, upper]")
    return span


Placed = Annotated[Mount, BeforeValidator(lambda v: {"link": v} if isinstance(v, str) else v)]
"""A mount, or the name of a link alone."""

Span = Annotated[tuple[float, float], Vector(2), AfterValidator(_check_span), WrapValidator(locate)]
"""Lower and upper limit."""

Inertias = Annotated[
    dict[Text, NotNegative],
    BeforeValidator(lambda v: v if isinstance(v, dict) else {".*": v}),
]
"""Values by pattern, or one for all joints."""


@checked(RobotError)
@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits that replace the document's, by pattern."""

    torque: dict[Text, Positive] = field(default_factory=dict[str, float])  # [N m]
    velocity: dict[Text, Positive] = field(default_factory=dict[str, float])  # [rad/s]
    # lower and upper [rad]
    position: dict[Text, Span] = field(default_factory=dict[str, tuple[float, float]])


@checked(RobotError)
@dataclass(frozen=True, kw_only=True)
class Description:
    """The facts that stand in a description file. Joint names are regular expressions."""

    where: str = field(default="a description", metadata=NOT_IN_FILES)  # the file, for messages
    base: Literal["floating", "fixed"]  # whether the root link is free or fixed in the world
    # the pelvis frame; for a fixed base it may be left out and is the root link
    pelvis: Placed | None = None
    torso: Placed | None = None  # the torso frame; as the pelvis
    # soles by name, left first
    soles: dict[Text, SoleMount] = field(default_factory=dict[str, SoleMount])
    # hand frames by name, left first
    hands: dict[Text, Placed] = field(default_factory=dict[str, Mount])
    # joint positions by pattern [rad]; joints not named are at zero
    home: dict[Text, Number] = field(default_factory=dict[str, float])
    limits: Limits = field(default_factory=Limits)  # limits that replace the document's
    # reflected rotor inertias by pattern [kg m^2]
    armature: Inertias = field(default_factory=dict[str, float])
    # joints that are welded at zero
    locked: tuple[Text, ...] = ()
    licence: Text = "not stated"  # the model's licence

    def __post_init__(self) -> None:
        missing = [key for key in ("pelvis", "torso", "soles") if not getattr(self, key)]
        if self.base == "floating" and missing:
            raise RobotError(
                "facts missing",
                got=missing,
                wanted="these keys for a floating base, with at least one sole",
            )
        self._check_patterns()
        names = ["pelvis", "torso", *self.soles, *self.hands]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise RobotError(
                "a frame's name stands twice",
                got=twice[0],
                wanted="names that differ for soles, hands, pelvis and torso",
            )

    def _check_patterns(self) -> None:
        limits = self.limits
        by_pattern = (self.home, limits.torque, limits.velocity, limits.position, self.armature)
        for pattern in (*(p for values in by_pattern for p in values), *self.locked):
            try:
                re.compile(pattern)
            except re.error as error:
                raise RobotError(
                    f"joint pattern cannot be read ({error})",
                    got=pattern,
                    wanted="a joint's name or a regular expression",
                ) from None

    def mounts(self) -> dict[str, Mount]:
        """All frames that the description names, by the name of their role."""
        trunk = {"pelvis": self.pelvis, "torso": self.torso}
        there = {name: mount for name, mount in trunk.items() if mount is not None}
        return {**self.soles, **self.hands, **there}


def parse_description(data: Mapping[Any, Any], where: str) -> Description:
    """Check the content of a description file and make it a `Description`."""
    return replace(read(Description, data, where, error=RobotError), where=where)


def match_joints(patterns: Mapping[str, T], joints: Iterable[str], what: str) -> dict[str, T]:
    """Give each joint the value of the last pattern that matches its whole name."""
    names = tuple(joints)
    found: dict[str, T] = {}
    for pattern, value in patterns.items():
        matching = [name for name in names if re.fullmatch(pattern, name)]
        if not matching:
            raise RobotError(
                f"{what} names no joint of the robot",
                got=pattern,
                wanted="a joint's name, or a regular expression for the whole name",
                choices=names,
            )
        found |= dict.fromkeys(matching, value)
    return found
