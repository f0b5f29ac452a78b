"""A stick figure for a URDF document without pictures, so that it can be seen when simulated."""

import xml.etree.ElementTree as ET

import numpy as np

from poise.robots._parametric import PALETTE, Shape, add_shape, rod, sphere

_ROD, _BALL = 0.02, 0.03
"""Radii of a stick and of the ball at each link's origin [m]."""

_SHORT = 0.01
"""Offsets shorter than this need no stick [m]."""


def has_shapes(root: ET.Element) -> bool:
    """Whether a document has anything to see or to touch."""
    return any(root.find(path) is not None for path in ("link/visual", "link/collision", ".//geom"))


def add_figure(root: ET.Element) -> bool:
    """Draw sticks between the joints of a URDF document, if it has no visual and no collision.

    Inertias stay as they are: only pictures are added.

    Args:
        root: the document's root element, changed in place.

    Returns:
        Whether anything was drawn.
    """
    if root.tag != "robot" or has_shapes(root):
        return False
    links = {link.get("name", ""): link for link in root.findall("link")}
    for link in links.values():
        if link.find("inertial") is not None:
            _draw(link, sphere(_BALL, colour="joint"))
    for joint in root.findall("joint"):
        parent, origin = joint.find("parent"), joint.find("origin")
        if parent is None or origin is None:
            continue
        end = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()])
        if np.linalg.norm(end) > _SHORT:
            _draw(links[parent.get("link", "")], rod((0.0, 0.0, 0.0), end.tolist(), _ROD))
    return True


def _draw(link: ET.Element, shape: Shape) -> None:
    visual = ET.SubElement(link, "visual")
    add_shape(visual, shape)
    material = ET.SubElement(visual, "material", name=f"figure_{shape.colour}")
    ET.SubElement(material, "color", rgba=" ".join(map(str, PALETTE[shape.colour])))
