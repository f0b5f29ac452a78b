"""A stick figure for a URDF document without pictures, so that it can be seen when simulated."""

import math
import xml.etree.ElementTree as ET

from poise.robots._urdf import end_of

_RADIUS = 0.02
"""Radius of the figure's sticks, and of the balls at their ends, which hide shorter sticks [m]."""


def has_shapes(root: ET.Element) -> bool:
    """True where a document has anything to see or to touch."""
    return any(root.find(path) is not None for path in ("link/visual", "link/collision", ".//geom"))


def add_figure(root: ET.Element) -> bool:
    """Draw sticks between the joints of a URDF without shapes; True where any were drawn."""
    if root.tag != "robot" or has_shapes(root):
        return False
    links = {link.get("name", ""): link for link in root.findall("link")}
    for link in links.values():
        if link.find("inertial") is not None:
            ball = f'<visual><geometry><sphere radius="{_RADIUS}"/></geometry></visual>'
            link.append(ET.fromstring(ball))
    for joint in root.findall("joint"):
        origin = joint.find("origin")
        text = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
        x, y, z = map(float, text.split())
        length = math.hypot(x, y, z)
        if length > _RADIUS:
            # The cylinder's z axis is tilted about y, then turned about z.
            rpy = f"0 {math.atan2(math.hypot(x, y), z)} {math.atan2(y, x)}"
            stick = (
                f'<visual><origin xyz="{x / 2} {y / 2} {z / 2}" rpy="{rpy}"/>'
                f'<geometry><cylinder radius="{_RADIUS}" length="{length}"/></geometry></visual>'
            )
            links[end_of(joint, "parent")].append(ET.fromstring(stick))
    return True
