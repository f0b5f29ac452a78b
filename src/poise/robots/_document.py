"""A robot's URDF or MJCF document, read and brought into the form the rest of Poise relies on.

In that form a floating base has no joint in the document (whoever builds a model adds one to the
root link), a fixed base hangs on a link called `world`, every URDF hinge has limits, and an MJCF
document includes no other file.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from poise.errors import RobotError

_HINGES = ("revolute", "continuous", "prismatic")
_KINDS = {"robot": "urdf", "mujoco": "mjcf"}
_NUMBERS = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "limit": ("lower", "upper", "effort", "velocity"),
}
"""Attributes of URDF elements that hold numbers."""


@dataclass(frozen=True, kw_only=True)
class Document:
    """A parsed document.

    Attributes:
        kind: its format.
        root: its root element; functions of this module change it in place.
        where: the file or the robot's name, for messages.
    """

    kind: Literal["urdf", "mjcf"]
    root: ET.Element
    where: str

    @property
    def text(self) -> str:
        """The document as text."""
        return ET.tostring(self.root, encoding="unicode")

    def links(self) -> tuple[str, ...]:
        """Names of the links (URDF) or bodies (MJCF)."""
        tag = "link" if self.kind == "urdf" else "body"
        return tuple(e.get("name", "") for e in self.root.iter(tag) if e.get("name"))

    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move, without a floating base."""
        if self.kind == "urdf":
            joints = (j for j in self.root.findall("joint") if j.get("type") in _HINGES)
        else:
            bodies = self.root.iter("body")
            joints = (j for b in bodies for j in b.findall("joint") if j.get("type") != "free")
        return tuple(j.get("name", "") for j in joints)


def parse(text: str, where: str, directory: Path | None = None) -> Document:
    """Parse URDF or MJCF text.

    Args:
        text: the document.
        where: the file or the robot's name, for messages.
        directory: where the files that an MJCF document includes are looked for.

    Returns:
        The document.

    Raises:
        RobotError: the text is no XML, neither URDF nor MJCF, or has no links or a nameless one.
    """
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise RobotError(f"{where} is not valid XML: {error}") from None
    kind = _KINDS.get(root.tag)
    if kind is None:
        raise RobotError(
            f"{where} is neither URDF nor MJCF",
            got=f"<{root.tag}>",
            wanted="<robot> (URDF) or <mujoco> (MJCF) as the root element",
        )
    if kind == "mjcf":
        _include(root, directory, depth=0)
    document = Document(kind="urdf" if kind == "urdf" else "mjcf", root=root, where=where)
    _check_names(document)
    return document


def end_of(joint: ET.Element, tag: str) -> str:
    """The parent or child link of a URDF joint; empty where it names none."""
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def write_limits(
    document: Document,
    position: Mapping[str, tuple[float, float]],
    velocity: Mapping[str, float],
    torque: Mapping[str, float],
) -> None:
    """Write limits into a URDF document; a joint that turns without end becomes a hinge.

    A hinge without limits gets limits of zero, which the loader reports later.

    Args:
        document: a URDF document, changed in place.
        position: position limits by joint [rad].
        velocity: velocity limits by joint [rad/s].
        torque: torque limits by joint [N m].
    """
    for joint in document.root.findall("joint"):
        if joint.get("type") not in _HINGES:
            continue
        name = joint.get("name", "")
        limit = joint.find("limit")
        if limit is None:
            limit = ET.SubElement(joint, "limit")
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit.set("lower", "0")
            limit.set("upper", "0")
        if name in position:
            limit.set("lower", repr(position[name][0]))
            limit.set("upper", repr(position[name][1]))
        for key, values in (("velocity", velocity), ("effort", torque)):
            limit.set(key, repr(values[name]) if name in values else limit.get(key, "0"))


def _check_names(document: Document) -> None:
    if not document.links():
        raise RobotError(f"{document.where} has no links", got=f"<{document.root.tag}>")
    names = document.joints()
    if "" in names:
        raise RobotError(f"{document.where} has a joint without a name", wanted="names for all")
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise RobotError(f"{document.where} has two joints of one name", got=twice)
    if document.kind == "urdf":
        _check_ends(document)
        _check_numbers(document)


def _check_ends(document: Document) -> None:
    links = document.links()
    for joint in document.root.findall("joint"):
        for tag in ("parent", "child"):
            if end_of(joint, tag) not in links:
                raise RobotError(
                    f"{document.where}: {tag} of joint {joint.get('name')!r} is no link",
                    got=end_of(joint, tag),
                    choices=links,
                )


def _check_numbers(document: Document) -> None:
    """Find what is not a number before Pinocchio's parser prints its own complaint."""
    for element in (*document.root.findall("link"), *document.root.findall("joint")):
        for inner in element.iter():
            for key in _NUMBERS.get(inner.tag, ()):
                text = inner.get(key, "0")
                if not text.split() or not all(_is_number(word) for word in text.split()):
                    raise RobotError(
                        f"{document.where}: {key} in <{inner.tag}> of {element.tag} "
                        f"{element.get('name')!r} is no number",
                        got=text,
                        wanted="finite numbers",
                    )


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _include(element: ET.Element, directory: Path | None, depth: int) -> None:
    """Put the content of included MJCF files in the place of each <include>."""
    for index, child in reversed(list(enumerate(element))):
        if child.tag != "include":
            _include(child, directory, depth)
            continue
        path = (directory or Path()) / child.get("file", "")
        if depth > 10 or not path.is_file():
            raise RobotError("an included MJCF file cannot be found", got=str(path))
        try:
            included = ET.fromstring(path.read_text(encoding="utf-8"))
        except ET.ParseError as error:
            raise RobotError(f"{path} is not valid XML: {error}") from None
        _include(included, directory, depth + 1)
        element.remove(child)
        for k, inner in enumerate(included):
            element.insert(index + k, inner)
