"""A robot as a tree of links and joints, and its URDF text."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from bundled_robots.solids import Shape, combined_inertia

PALETTE = {
    "shell": (0.90, 0.91, 0.93, 1.0),
    "accent": (0.95, 0.47, 0.13, 1.0),
    "blue": (0.10, 0.42, 0.85, 1.0),
    "joint": (0.20, 0.22, 0.26, 1.0),
    "dark": (0.12, 0.13, 0.16, 1.0),
    "visor": (0.05, 0.30, 0.42, 1.0),
    "light": (0.35, 0.85, 0.95, 1.0),
}
"""Colours by name: red, green, blue, opacity."""

_AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


@dataclass(frozen=True, kw_only=True)
class Link:
    """A rigid body: solids of one density."""

    name: str  # name of the link
    mass: float  # mass [kg]
    shapes: tuple[Shape, ...]  # its solids; their volumes share the mass


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A hinge between two links, or a weld where `axis` is "fixed"."""

    name: str  # name of the joint
    parent: str  # the link it hangs from
    child: str  # the link it moves; its frame lies in the joint
    position: tuple[float, float, float]  # place of the joint in the parent [m]
    axis: Literal["x", "y", "z", "fixed"]  # the joint's axis, along the child's own axes
    lower: float = 0.0  # lower limit [rad]
    upper: float = 0.0  # upper limit [rad]
    torque: float = 0.0  # torque limit [N m]
    velocity: float = 0.0  # velocity limit [rad/s]


class Hinge(NamedTuple):
    """Data of a hinge before it stands in a robot."""

    name: str  # name of the joint, without its side
    axis: Literal["x", "y", "z"]  # the joint's axis
    span: tuple[float, float]  # position limits, of the left one of a pair [deg]
    torque: float  # torque limit, of a robot of 1.8 m and 100 kg where strengths are scaled [N m]


@dataclass
class Tree:
    """Links and joints under construction."""

    name: str  # name of the robot
    links: list[Link] = field(default_factory=list[Link])  # the links, the root first
    # The joints, in the order they were added
    joints: list[Joint] = field(default_factory=list[Joint])

    def add(self, name: str, mass: float, shapes: Iterable[Shape]) -> None:
        """Add a link of the given mass [kg]."""
        self.links.append(Link(name=name, mass=mass, shapes=tuple(shapes)))

    def connect(
        self,
        hinge: Hinge,  # name, axis, limits
        parent: str,  # the link it hangs from
        child: str,  # the link it moves
        *,
        at: tuple[float, float, float],  # its place in the parent [m]
        velocity: float,  # velocity limit [rad/s]
        strength: float = 1.0,  # factor on the torque limit
        # Of a pair; on the right, limits about x and z are mirrored
        side: Literal["left", "right"] | None = None,
    ) -> None:
        """Add a hinge between two links."""
        low, high = (math.radians(angle) for angle in hinge.span)
        if side == "right" and hinge.axis != "y":
            low, high = -high, -low
        self.joints.append(
            Joint(
                name=hinge.name if side is None else f"{side}_{hinge.name}",
                parent=parent,
                child=child,
                position=at,
                axis=hinge.axis,
                lower=low,
                upper=high,
                torque=hinge.torque * strength,
                velocity=velocity,
            )
        )

    def weld(self, parent: str, child: str, *, at: tuple[float, float, float]) -> None:
        """Fix a link to another at `at` [m]."""
        name = f"{child.removesuffix('_link')}_weld"
        joint = Joint(name=name, parent=parent, child=child, position=at, axis="fixed")
        self.joints.append(joint)

    def urdf(self) -> str:
        """The whole robot as URDF text."""
        root = ET.Element("robot", name=self.name)
        for colour, rgba in PALETTE.items():
            material = ET.SubElement(root, "material", name=colour)
            ET.SubElement(material, "color", rgba=_text(rgba))
        for link in self.links:
            _add_link(root, link)
        for joint in self.joints:
            _add_joint(root, joint)
        ET.indent(root)
        return ET.tostring(root, encoding="unicode") + "\n"


def _add_link(root: ET.Element, link: Link) -> None:
    element = ET.SubElement(root, "link", name=link.name)
    inertia = combined_inertia(link.shapes, link.mass)
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=_text(inertia.lever), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(float(inertia.mass)))
    matrix = inertia.inertia
    ET.SubElement(
        inertial,
        "inertia",
        {
            f"i{'xyz'[i]}{'xyz'[j]}": repr(float(matrix[i, j]))
            for i in range(3)
            for j in range(i, 3)
        },
    )
    for shape in link.shapes:
        visual = ET.SubElement(element, "visual")
        add_shape(visual, shape)
        ET.SubElement(visual, "material", name=shape.colour)
    for shape in link.shapes:
        if shape.solid:
            add_shape(ET.SubElement(element, "collision"), shape)


def add_shape(element: ET.Element, shape: Shape) -> None:
    """Write a shape's origin and geometry into a visual or collision element of URDF."""
    ET.SubElement(element, "origin", xyz=_text(shape.position), rpy=_text(shape.rpy))
    geometry = ET.SubElement(element, "geometry")
    if shape.kind == "box":
        ET.SubElement(geometry, "box", size=_text(shape.size))
    elif shape.kind == "cylinder":
        radius, length = shape.size
        ET.SubElement(geometry, "cylinder", radius=repr(radius), length=repr(length))
    else:
        ET.SubElement(geometry, "sphere", radius=repr(shape.size[0]))


def _add_joint(root: ET.Element, joint: Joint) -> None:
    kind = "fixed" if joint.axis == "fixed" else "revolute"
    element = ET.SubElement(root, "joint", name=joint.name, type=kind)
    ET.SubElement(element, "origin", xyz=_text(joint.position), rpy="0 0 0")
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    if joint.axis == "fixed":
        return
    ET.SubElement(element, "axis", xyz=_AXES[joint.axis])
    ET.SubElement(
        element,
        "limit",
        lower=repr(joint.lower),
        upper=repr(joint.upper),
        effort=repr(joint.torque),
        velocity=repr(joint.velocity),
    )


def _text(values: Iterable[float]) -> str:
    # Rounding at a nanometre leaves no noise in the text; inertias keep all their digits.
    return " ".join(repr(round(float(v), 9) + 0.0) for v in values)
