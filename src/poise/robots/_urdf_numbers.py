"""The numbers of a URDF document: `check_numbers` finds what is wrong before anybody reads it."""

import math
import xml.etree.ElementTree as ET

from poise.errors import RobotError

INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Attributes of a URDF's <inertia>."""

_COUNTS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(INERTIA, 1),
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}
"""How many numbers the attributes of URDF elements hold."""

_MOVING = ("revolute", "continuous", "prismatic", "planar")
"""Types of joints that have an axis; exporters write one of zeros for joints that are fixed."""

_NO_AXIS = 1e-12
"""An axis this short has no direction."""


def check_numbers(root: ET.Element, where: str) -> None:
    """Check that each attribute which holds numbers has as many as it needs, and what needs some.

    Pinocchio's parser prints its own complaint of some, and leaves out a link's mass for others.
    It takes an axis of zeros and a mass without inertia, which MuJoCo refuses.

    Args:
        root: a URDF document's root element.
        where: the file, for messages.

    Raises:
        RobotError: an attribute has too few or too many, or something that is no number; the axis
            of a joint is zero; an <inertial> lacks its <mass> or its <inertia>.
    """
    for element in (*root.findall("link"), *root.findall("joint")):
        for inner in element.iter():
            for key, count in _COUNTS.get(inner.tag, {}).items():
                text = inner.get(key)
                if text is None or _holds(text, count):
                    continue
                raise RobotError(
                    f"{where}: {key} in <{inner.tag}> of {element.tag} {element.get('name')!r} "
                    f"is {'no number' if count == 1 else f'not {count} numbers'}",
                    got=text,
                    wanted="a finite number" if count == 1 else f"{count} finite numbers",
                )
    for link in root.findall("link"):
        _check_inertial(link, where)
    for joint in root.findall("joint"):
        _check_axis(joint, where)


def _check_inertial(link: ET.Element, where: str) -> None:
    inertial = link.find("inertial")
    if inertial is None:
        return
    tags = [part.tag for part in inertial]
    for tag in ("mass", "inertia"):
        if tag not in tags:
            raise RobotError(
                f"{where}: the <inertial> of link {link.get('name')!r} has no <{tag}>",
                got=", ".join(f"<{t}>" for t in tags) or "nothing in it",
                wanted="both <mass> and <inertia>, or no <inertial>",
            )


def _check_axis(joint: ET.Element, where: str) -> None:
    axis = joint.find("axis")
    text = None if axis is None else axis.get("xyz")
    if joint.get("type") not in _MOVING or text is None:
        return
    if math.hypot(*map(float, text.split())) < _NO_AXIS:
        raise RobotError(
            f"{where}: the axis of joint {joint.get('name')!r} has no direction",
            got=text,
            wanted='three numbers that are not all zero, such as "0 1 0"',
        )


def _holds(text: str, count: int) -> bool:
    words = text.split()
    return len(words) == count and all(is_number(word) for word in words)


def is_number(word: str) -> bool:
    """Whether a word is a finite number."""
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False
