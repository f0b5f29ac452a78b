"""Which body of an MJCF document is the robot, and what is taken out of the document around it."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Literal

from poise.errors import RobotError
from poise.robots._document import Document

_LEFT_OUT = (
    "actuator", "contact", "custom", "deformable", "equality", "keyframe", "option", "sensor",
    "size", "tendon",
)  # fmt: skip
"""Sections that the plant and the controller bring themselves, or that a `Robot` does not have."""

_SPRINGS = ("stiffness", "springref", "springdamper")
"""Attributes of joints that would push in the plant while the controller knows of no spring."""

_PLACEMENT = ("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler")
"""Attributes that place an MJCF body."""


def settle_mjcf(document: Document, base: Literal["floating", "fixed"]) -> str:
    """Leave one robot in an MJCF document: its only root body, without what others bring.

    Args:
        document: the document, changed in place.
        base: whether the root is free or fixed.

    Returns:
        The root body.

    Raises:
        RobotError: no single root body that moves, or a free joint where the base is fixed.
    """
    root = root_body(document)
    free = [j for j in root if j.tag == "freejoint" or j.get("type") == "free"]
    if free and base == "fixed":
        raise RobotError(
            f"{document.where} has a free joint, but its description says base: fixed",
            got=root.get("name"),
            wanted="base: floating",
        )
    for joint in free:
        root.remove(joint)
    if base == "floating":
        for key in _PLACEMENT:
            root.attrib.pop(key, None)
    _keep_only(document.root, root, floating=base == "floating")
    for tag in _LEFT_OUT:
        for element in document.root.findall(tag):
            document.root.remove(element)
    for joint in document.root.iter("joint"):
        for key in _SPRINGS:
            joint.attrib.pop(key, None)
    for body in document.root.iter("body"):
        body.attrib.pop("gravcomp", None)
    return root.get("name", "")


def free_site_names(root: ET.Element, taken: set[str]) -> None:
    """Rename sites of an MJCF document that have the name of a role, which means the role."""
    for site in root.iter("site"):
        if site.get("name") in taken:
            site.set("name", f"{site.get('name')}_site")


def root_body(document: Document) -> ET.Element:
    """The only body of the world that has joints; bodies that nothing moves are scenery."""
    roots = [b for w in document.root.findall("worldbody") for b in _bodies(w)]
    moving = [b for b in roots if any(j.get("type") != "free" for j in b.iter("joint"))]
    if len(moving) != 1:
        raise RobotError(
            f"{document.where} has no single root body",
            got=[b.get("name") for b in moving or roots],
            wanted="one body with joints under <worldbody>: take the other robots out of the file",
        )
    return moving[0]


def _bodies(element: ET.Element) -> Iterator[ET.Element]:
    for child in element:
        if child.tag == "body":
            yield child
        elif child.tag == "frame":
            yield from _bodies(child)


def _keep_only(document: ET.Element, root: ET.Element, *, floating: bool) -> None:
    """Take all else out of the world; a floating root stands in it without a frame.

    Sites beside a fixed root are frames that tasks may name; a floating one would carry them along.
    """
    sites = () if floating else ("site",)
    for world in document.findall("worldbody"):
        frames = _frames_in(world, root)
        for place in [world, *frames]:
            for child in [
                c for c in place if c is not root and c not in frames and c.tag not in sites
            ]:
                place.remove(child)
        if floating and frames:
            classes = (e.get("childclass") for e in (root, *reversed(frames)))
            if nearest := next(filter(None, classes), None):
                root.set("childclass", nearest)
            world[:] = [root]
    _drop_lost_targets(root)


def frames_around(document: ET.Element, root: ET.Element) -> list[ET.Element]:
    """The frames of the world that a body stands in, outermost first."""
    return [f for world in document.findall("worldbody") for f in _frames_in(world, root)]


def _frames_in(place: ET.Element, root: ET.Element) -> list[ET.Element]:
    for frame in place.findall("frame"):
        if root in list(frame):
            return [frame]
        if inner := _frames_in(frame, root):
            return [frame, *inner]
    return []


def placement_of(element: ET.Element) -> dict[str, str]:
    """The attributes that place a body or a frame."""
    return {key: element.attrib[key] for key in _PLACEMENT if key in element.attrib}


def _drop_lost_targets(root: ET.Element) -> None:
    """Take out the robot's lights and cameras that follow a body which is gone."""
    bodies = {body.get("name") for body in root.iter("body")}
    for parent in list(root.iter()):
        for child in [c for c in parent if c.tag in ("light", "camera")]:
            if child.get("target") not in (None, *bodies):
                parent.remove(child)
