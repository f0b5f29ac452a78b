"""`Description`: the facts about a robot that its URDF or MJCF does not hold."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

import numpy as np
from jaxtyping import Float64

from poise._fields import Fields
from poise.errors import RobotError

T = TypeVar("T")

KEYS = (
    "base",
    "pelvis",
    "torso",
    "soles",
    "hands",
    "home",
    "limits",
    "armature",
    "locked",
    "licence",
)
"""The keys of a description file."""

_NEEDED_BY_FLOATING = ("pelvis", "torso", "soles")


@dataclass(frozen=True, kw_only=True)
class Mount:
    """Where a frame sits on a link.

    Attributes:
        link: the link.
        position: origin of the frame in the link [m].
        rpy: roll, pitch, yaw of the frame in the link, as in URDF [rad].
    """

    link: str
    position: Float64[np.ndarray, "3"]
    rpy: Float64[np.ndarray, "3"]


@dataclass(frozen=True, kw_only=True)
class SoleMount:
    """A mount with a sole's size.

    Attributes:
        mount: the centre of the sole, x forward and z up.
        length: along x [m].
        width: along y [m].
    """

    mount: Mount
    length: float
    width: float


@dataclass(frozen=True, kw_only=True)
class Description:
    """The facts that stand in a description file. Joint names are regular expressions.

    Attributes:
        where: the file, for messages.
        base: whether the root link is free or fixed in the world.
        pelvis: the pelvis frame; for a fixed base it may be left out and is the root link.
        torso: the torso frame; as the pelvis.
        soles: soles by name, left first.
        hands: hand frames by name, left first.
        home: joint positions by pattern [rad]; joints not named are at zero.
        torque: torque limits that replace the document's [N m].
        velocity: velocity limits that replace the document's [rad/s].
        position: position limits that replace the document's [rad].
        armature: reflected rotor inertias [kg m^2].
        locked: joints that are welded at zero.
        licence: the model's licence.
    """

    where: str
    base: Literal["floating", "fixed"]
    pelvis: Mount | None = None
    torso: Mount | None = None
    soles: Mapping[str, SoleMount] = field(default_factory=dict[str, SoleMount])
    hands: Mapping[str, Mount] = field(default_factory=dict[str, Mount])
    home: Mapping[str, float] = field(default_factory=dict[str, float])
    torque: Mapping[str, float] = field(default_factory=dict[str, float])
    velocity: Mapping[str, float] = field(default_factory=dict[str, float])
    position: Mapping[str, tuple[float, float]] = field(
        default_factory=dict[str, tuple[float, float]]
    )
    armature: Mapping[str, float] = field(default_factory=dict[str, float])
    locked: tuple[str, ...] = ()
    licence: str = "not stated"

    def mounts(self) -> dict[str, Mount]:
        """All frames that the description names, by the name of their role."""
        soles = {name: sole.mount for name, sole in self.soles.items()}
        trunk = {"pelvis": self.pelvis, "torso": self.torso}
        return soles | dict(self.hands) | {k: m for k, m in trunk.items() if m is not None}


def parse_description(data: Mapping[Any, Any], where: str) -> Description:
    """Check the content of a description file and make it a `Description`.

    Args:
        data: the file's content, as the YAML parser gave it.
        where: the file, for messages.

    Returns:
        The description. Names of links and joints are checked later, against the document.

    Raises:
        RobotError: a fact is missing or has the wrong kind, a key is unknown, a length negative, a
            pattern no regular expression.
    """
    fields = Fields(data, where, KEYS, error=RobotError)
    base = _base(fields)
    if base == "floating":
        missing = [key for key in _NEEDED_BY_FLOATING if key not in fields]
        if missing:
            raise RobotError(
                f"facts missing in {where}", got=missing, wanted="these keys for a floating base"
            )
    limits = fields.section("limits", ("torque", "velocity", "position"))
    description = Description(
        where=where,
        base=base,
        pelvis=_mount_at(fields, "pelvis") if "pelvis" in fields else None,
        torso=_mount_at(fields, "torso") if "torso" in fields else None,
        soles=fields.section("soles").each(_sole),
        hands=fields.section("hands").each(_mount_at),
        home=fields.section("home").each(Fields.number),
        torque=limits.section("torque").each(_positive),
        velocity=limits.section("velocity").each(_positive),
        position=limits.section("position").each(_span),
        armature=_armature(fields),
        locked=fields.texts("locked") if "locked" in fields else (),
        licence=fields.text("licence") if "licence" in fields else "not stated",
    )
    _check_patterns(description)
    _check_roles(description)
    return description


def match_joints(patterns: Mapping[str, T], joints: Iterable[str], what: str) -> dict[str, T]:
    """Give each joint the value of the last pattern that matches its whole name.

    Args:
        patterns: values by regular expression.
        joints: names of the joints.
        what: where the patterns stand, for messages.

    Returns:
        Values by joint, for the joints that a pattern matches.

    Raises:
        RobotError: a pattern matches no joint.
    """
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


def _base(fields: Fields) -> Literal["floating", "fixed"]:
    if "base" not in fields:
        raise RobotError(
            f"facts missing in {fields.where}", got=["base"], choices=("floating", "fixed")
        )
    base = fields.raw("base")
    if base == "floating":
        return "floating"
    if base == "fixed":
        return "fixed"
    raise RobotError(f"{fields.where}: unknown base", got=base, choices=("floating", "fixed"))


def _mount_at(fields: Fields, key: str) -> Mount:
    """A link's name alone, or a link with a placement."""
    if isinstance(fields.raw(key), str):
        return Mount(link=fields.text(key), position=np.zeros(3), rpy=np.zeros(3))
    return _mount(fields.section(key, ("link", "position", "rpy")))


def _mount(fields: Fields) -> Mount:
    return Mount(
        link=fields.text("link"),
        position=fields.numbers("position", 3) if "position" in fields else np.zeros(3),
        rpy=fields.numbers("rpy", 3) if "rpy" in fields else np.zeros(3),
    )


def _sole(fields: Fields, key: str) -> SoleMount:
    sole = fields.section(key, ("link", "position", "rpy", "length", "width"))
    return SoleMount(
        mount=_mount(sole),
        length=sole.number("length", positive=True),
        width=sole.number("width", positive=True),
    )


def _positive(fields: Fields, key: str) -> float:
    return fields.number(key, positive=True)


def _span(fields: Fields, key: str) -> tuple[float, float]:
    low, high = (float(x) for x in fields.numbers(key, 2))
    if low >= high:
        raise RobotError(
            f"{fields.where}.{key}: limits cross", got=[low, high], wanted="[lower, upper]"
        )
    return low, high


def _armature(fields: Fields) -> dict[str, float]:
    if "armature" not in fields:
        return {}
    if not isinstance(fields.raw("armature"), dict):
        return {".*": fields.number("armature", minimum=0.0)}
    return fields.section("armature").each(lambda f, key: f.number(key, minimum=0.0))


def _check_patterns(description: Description) -> None:
    d = description
    patterns = (*d.home, *d.torque, *d.velocity, *d.position, *d.armature, *d.locked)
    for pattern in patterns:
        try:
            re.compile(pattern)
        except re.error as error:
            raise RobotError(
                f"{d.where}: joint pattern cannot be read ({error})",
                got=pattern,
                wanted="a joint's name or a regular expression",
            ) from None


def _check_roles(description: Description) -> None:
    taken: set[str] = {"pelvis", "torso"}
    for name in (*description.soles, *description.hands):
        if name in taken:
            raise RobotError(
                f"{description.where}: a frame's name stands twice",
                got=name,
                wanted="names that differ for soles, hands, pelvis and torso",
            )
        taken.add(name)
    if description.base == "floating" and not description.soles:
        raise RobotError(f"{description.where}: soles", got={}, wanted="at least one sole")
