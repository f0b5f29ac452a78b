"""A robot's URDF or MJCF document, read and brought into the form the rest of Poise relies on.

In that form a floating base has no joint in the document (whoever builds a model adds one to the
root link), a fixed base hangs on a link called `world`, every URDF hinge has limits, and an MJCF
document includes no other file and names all its bodies and joints.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float64

from poise.errors import RobotError
from poise.robots._urdf_numbers import INERTIA, check_numbers, is_number

_HINGES = ("revolute", "continuous", "prismatic")
_KINDS = {"robot": "urdf", "mujoco": "mjcf"}


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
            worlds = self.root.findall("worldbody")
            joints = (j for w in worlds for j in w.iter("joint") if j.get("type") != "free")
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
    if kind == "urdf":
        _drop_extensions(root)
        _tidy_shapes(root)
    else:
        _include(root, directory, where, depth=0)
        _name_all(root)
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


def mend_inertias(document: Document) -> list[str]:
    """Make a URDF's rotational inertias possible: no principal one above the sum of the others.

    The largest is lowered to that sum, in both engines' models; MuJoCo refuses such a body.

    Args:
        document: a document, changed in place; MuJoCo has checked an MJCF itself.

    Returns:
        The links whose inertia was changed.
    """
    if document.kind != "urdf":
        return []
    mended: list[str] = []
    for link in document.root.findall("link"):
        inertial, element = link.find("inertial"), link.find("inertial/inertia")
        if inertial is None or element is None:
            continue
        _, inertia = _inertial_numbers(inertial)
        values, axes = np.linalg.eigh(inertia)
        most = values[0] + values[1]
        if values[2] <= most * (1.0 + _ROUNDING) or most <= 0.0:
            continue
        values[2] = most
        possible = axes * values @ axes.T
        for key, (i, j) in zip(INERTIA, _ENTRIES, strict=True):
            element.set(key, repr(float(possible[i, j])))
        mended.append(link.get("name", ""))
    return mended


_ENTRIES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Where ixx, ixy, ixz, iyy, iyz, izz stand."""


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
        check_numbers(document.root, document.where)
    _check_inertias(document)


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


_ROUNDING = 1e-6
"""Part of the largest inertia that a written one may be below zero by its rounding."""


def _check_inertias(document: Document) -> None:
    """Find masses and inertias below zero, which no body has; zero is checked where it matters."""
    tag = "link" if document.kind == "urdf" else "body"
    for element in document.root.iter(tag):
        inertial = element.find("inertial")
        if inertial is None:
            continue
        mass, inertia = _inertial_numbers(inertial)
        values = np.linalg.eigvalsh(inertia)
        if mass < 0.0 or values[0] < -_ROUNDING * max(abs(values)) - 1e-12:
            raise RobotError(
                f"{document.where}: {tag} {element.get('name')!r} has a negative mass or inertia",
                got=f"mass {mass:g} kg, principal inertias {_written(values)} kg m^2",
                wanted="an <inertial> with a mass and principal inertias above zero",
            )


def _written(values: Iterable[float]) -> str:
    return ", ".join(f"{v:.4g}" for v in values)


def _inertial_numbers(
    inertial: ET.Element,
) -> tuple[float, Float64[np.ndarray, "3 3"]]:
    """The mass [kg] and the inertia [kg m^2] of an element; what it lacks is zero."""
    parts = {part.tag: part for part in inertial}
    if parts:
        entries = parts.get("inertia", ET.Element("inertia"))
        xx, xy, xz, yy, yz, zz = (float(entries.get(k, "0")) for k in INERTIA)
        mass = float(parts.get("mass", ET.Element("mass")).get("value", "0"))
    else:
        (mass,) = _floats(inertial.get("mass", "0"))
        xx, yy, zz = _floats(inertial.get("diaginertia", "0 0 0"), 3)
        full = inertial.get("fullinertia")
        xy = xz = yz = 0.0
        if full is not None:
            xx, yy, zz, xy, xz, yz = _floats(full, 6)
    return mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _floats(text: str, count: int = 1) -> list[float]:
    """The numbers of an attribute; zeros where it has not so many, for MuJoCo to complain about."""
    words = text.split()
    if len(words) != count or not all(is_number(w) for w in words):
        return [0.0] * count
    return [float(w) for w in words]


_URDF_PARTS = ("link", "joint", "material")


def _drop_extensions(root: ET.Element) -> None:
    """Take out what other programs put into a URDF, which may have links and meshes of its own."""
    for element in [e for e in root if e.tag not in _URDF_PARTS]:
        root.remove(element)


def _tidy_shapes(root: ET.Element) -> None:
    """Take out what MuJoCo does not read: shapes of no size, and names that stand twice."""
    seen: set[str] = set()
    for link in root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            if _is_nothing(shape):
                link.remove(shape)
            elif (name := shape.get("name")) in seen:
                del shape.attrib["name"]
            elif name is not None:
                seen.add(name)


def _is_nothing(shape: ET.Element) -> bool:
    """Whether a primitive shape has a size of zero."""
    sizes = [
        solid.get(key, "")
        for solid in shape.iterfind("geometry/*")
        for key in ("radius", "length", "size")
        if solid.tag != "mesh" and solid.get(key)
    ]
    return any(is_number(word) and float(word) <= 0.0 for text in sizes for word in text.split())


def _include(element: ET.Element, directory: Path | None, where: str, depth: int) -> None:
    """Put the content of included MJCF files in the place of each <include>."""
    for index, child in reversed(list(enumerate(element))):
        if child.tag != "include":
            _include(child, directory, where, depth)
            continue
        path = (directory or Path()) / child.get("file", "")
        if depth > 10 or not path.is_file():
            raise RobotError(
                f"a file included by {where} cannot be found",
                got=str(path),
                wanted="the file at that place, or the <include> taken out",
            )
        try:
            included = ET.fromstring(path.read_text(encoding="utf-8"))
        except ET.ParseError as error:
            raise RobotError(f"{path} is not valid XML: {error}") from None
        _include(included, directory, path.name, depth + 1)
        element.remove(child)
        for k, inner in enumerate(included):
            element.insert(index + k, inner)


def _name_all(root: ET.Element) -> None:
    """Name the bodies and joints that an MJCF document leaves without a name."""
    worlds = root.findall("worldbody")
    bodies = {b.get("name", "") for w in worlds for b in w.iter("body")}
    joints = {j.get("name", "") for w in worlds for j in w.iter("joint")}
    for number, body in enumerate(b for w in worlds for b in w.iter("body")):
        if not body.get("name"):
            _name(body, f"body{number + 1}", bodies)
        hinges = [j for j in _own(body, "joint") if not j.get("name") and j.get("type") != "free"]
        for k, joint in enumerate(hinges):
            number_of_it = k + 1 if len(hinges) > 1 else ""
            _name(joint, f"{body.get('name')}_joint{number_of_it}", joints)


def _name(element: ET.Element, name: str, taken: set[str]) -> None:
    """Give an element a name, or one like it where others have it."""
    while name in taken:
        name += "_"
    element.set("name", name)
    taken.add(name)


def _own(body: ET.Element, tag: str) -> Iterator[ET.Element]:
    """Elements of a body itself, also where frames of the document stand around them."""
    for child in body:
        if child.tag == tag:
            yield child
        elif child.tag == "frame":
            yield from _own(child, tag)
