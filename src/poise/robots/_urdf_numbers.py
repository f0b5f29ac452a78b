"""The numbers of a URDF document: `check_numbers` finds what is none before anybody reads it."""

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


def check_numbers(root: ET.Element, where: str) -> None:
    """Check that each attribute which holds numbers has as many as it needs.

    Pinocchio's parser prints its own complaint of some, and leaves out a link's mass for others.

    Args:
        root: a URDF document's root element.
        where: the file, for messages.

    Raises:
        RobotError: an attribute has too few or too many, or something that is no number.
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


def _holds(text: str, count: int) -> bool:
    words = text.split()
    return len(words) == count and all(is_number(word) for word in words)


def is_number(word: str) -> bool:
    """Whether a word is a finite number."""
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False
