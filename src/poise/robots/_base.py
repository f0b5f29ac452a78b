"""The root of a robot's document, brought into one form whether it is free or fixed."""

import xml.etree.ElementTree as ET
from typing import Literal

from poise.errors import RobotError
from poise.robots._document import Document, end_of
from poise.robots._mjcf_facts import MjcfFacts
from poise.robots._mjcf_world import settle_mjcf

WORLD = "world"
"""The link that a fixed base hangs on."""


def settle_base(document: Document, base: Literal["floating", "fixed"]) -> str:
    """Give the document's root the form that Poise relies on.

    Args:
        document: the document, changed in place.
        base: whether the root is free or fixed.

    Returns:
        The root link.

    Raises:
        RobotError: the document has no single root link, or a joint that contradicts `base`.
    """
    if document.kind == "urdf":
        return _settle_urdf(document, base)
    return settle_mjcf(document, base)


def followers_of(document: Document, mjcf: MjcfFacts | None) -> list[str]:
    """Joints that the document ties to others: a `Robot` has them welded at zero."""
    if mjcf is not None:
        return list(mjcf.followers)
    tied = (j for j in document.root.findall("joint") if j.find("mimic") is not None)
    return [name for j in tied if (name := j.get("name", "")) in document.joints()]


def leaders_of(document: Document, mjcf: MjcfFacts | None) -> set[str]:
    """Joints that the document ties others to, as it does with those of grippers."""
    if mjcf is not None:
        return set(mjcf.leaders)
    return {m.get("joint", "") for m in document.root.iterfind("joint/mimic")}


def _settle_urdf(document: Document, base: Literal["floating", "fixed"]) -> str:
    root = _root_link(document)
    floating = [j for j in document.root.findall("joint") if j.get("type") == "floating"]
    if floating and base == "fixed":
        raise RobotError(
            f"{document.where} has a floating joint, but its description says base: fixed",
            got=[j.get("name") for j in floating],
            wanted="base: floating",
        )
    if len(floating) > 1 or (floating and not _is_base(document, floating[0], root)):
        raise RobotError(
            f"{document.where} has a floating joint that is not its base",
            got=[j.get("name") for j in floating],
            wanted="at most one, from a root link that carries nothing else",
        )
    if floating:
        document.root.remove(floating[0])
        for link in document.root.findall("link"):
            if link.get("name") == root:
                document.root.remove(link)
        return _root_link(document)
    if base == "floating" and root == WORLD:
        return _freed(document)
    if base == "fixed" and root != WORLD:
        ET.SubElement(document.root, "link", name=WORLD)
        joint = ET.SubElement(document.root, "joint", name="world_weld", type="fixed")
        ET.SubElement(joint, "parent", link=WORLD)
        ET.SubElement(joint, "child", link=root)
    return root


def _freed(document: Document) -> str:
    """Take the link `world` from under a robot that is to float: MuJoCo has a world of its own.

    Raises:
        RobotError: the link has a mass, or is more than what one fixed joint hangs on.
    """
    carried = [j for j in document.root.findall("joint") if end_of(j, "parent") == WORLD]
    (world,) = (e for e in document.root.findall("link") if e.get("name") == WORLD)
    bare = world.find("inertial") is None
    if not bare or len(carried) != 1 or carried[0].get("type") != "fixed":
        raise RobotError(
            f"{document.where} has a root link {WORLD!r} that is part of the robot",
            got=[j.get("name") for j in carried],
            wanted="another name for this link, or one fixed joint from it to the robot",
        )
    document.root.remove(world)
    document.root.remove(carried[0])
    return _root_link(document)


def _is_base(document: Document, joint: ET.Element, root: str) -> bool:
    """Whether a floating joint is all that a root link without mass carries."""
    carried = [j for j in document.root.findall("joint") if end_of(j, "parent") == root]
    links = [e for e in document.root.findall("link") if e.get("name") == root]
    return carried == [joint] and all(link.find("inertial") is None for link in links)


def _root_link(document: Document) -> str:
    """The link that no joint moves; all others hang on it, each by one joint."""
    joints = [(end_of(j, "parent"), end_of(j, "child")) for j in document.root.findall("joint")]
    children = [child for _, child in joints]
    roots = [name for name in document.links() if name not in children]
    if len(roots) != 1:
        raise RobotError(
            f"{document.where} has no single root link",
            got=roots,
            wanted="one link that no joint moves: a <joint> to each of the others, or these taken "
            "out of the file",
        )
    reached = list(roots)
    for link in reached:
        reached += [child for parent, child in joints if parent == link]
        if len(reached) > len(document.links()):
            break
    if sorted(reached) != sorted(document.links()):
        strange = sorted(name for name in document.links() if reached.count(name) != 1)
        raise RobotError(
            f"{document.where} is not a tree of links",
            got=strange,
            wanted="one joint from the root's side to each of these links",
        )
    return roots[0]
