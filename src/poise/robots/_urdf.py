"""URDF: faults that published files have repaired, others refused by name, and its model."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import few
from poise.errors import RobotError, UnknownNameError
from poise.robots._document import (
    INERTIA,
    WORLD,
    Base,
    Coupling,
    Document,
    Facts,
    JointLimits,
    free_name,
    is_number,
)
from poise.robots._mesh_files import find_mesh, package_folders
from poise.robots._noise import captured

_ENDS = ("limit[@lower]", "limit[@upper]")
_HINGES = ("revolute", "continuous", "prismatic")
_PARTS = ("link", "joint", "material")
"""Elements of a robot; others are those of simulators, with links and meshes of their own."""

_SINGLE = {
    "link": ("inertial",),
    "joint": ("origin", "parent", "child", "axis", "limit", "mimic", "dynamics"),
    "visual": ("origin", "geometry", "material"),
    "collision": ("origin", "geometry"),
    "inertial": ("origin", "mass", "inertia"),
}  # Elements that may stand once in another
_COUNTS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(INERTIA, 1),
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "mimic": {"multiplier": 1, "offset": 1},
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}  # How many numbers the attributes of elements hold


_XACRO, _SOURCE = "xacro", frozenset({"include", "macro", "property", "arg"})
"""Part of the namespace of xacro, and its elements that no expanded document has."""


class UrdfDocument(Document):
    """A URDF document."""

    kind = "urdf"
    link_tag = "link"

    def joints(self) -> tuple[str, ...]:
        return tuple(j.get("name", "") for j in self._joints() if j.get("type") in _HINGES)

    def _joints(self) -> list[ET.Element]:
        return self.root.findall("joint")

    def _read_facts(self) -> Facts:
        parents = {end_of(j, "parent") for j in self._joints()}
        children = {end_of(j, "child") for j in self._joints()}
        free = any(j.get("type") == "floating" for j in self._joints())
        tied = ((j, j.find("mimic")) for j in self._joints() if j.get("type") in _HINGES)
        return Facts(
            fixed=WORLD in parents - children and not free,
            free=free,
            couplings=tuple(
                Coupling(
                    follower=joint.get("name", ""),
                    leader=mimic.get("joint", ""),
                    offset=float(mimic.get("offset", "0")),
                    ratio=float(mimic.get("multiplier", "1")),
                )
                for joint, mimic in tied
                if mimic is not None
            ),
        )

    def settle(self, base: Base) -> str:
        root = self._root_link()
        if root != WORLD and WORLD in self.links():
            what = f"{self.where} has a link {WORLD!r} that is not its root"
            raise RobotError(what, wanted="another name for it")
        floating = [j for j in self._joints() if j.get("type") == "floating"]
        names = [j.get("name") for j in floating]
        if floating and base == "fixed":
            what = f"{self.where} has a floating joint, which contradicts a fixed base"
            wanted = "base: floating in its description, with the soles it stands on"
            raise RobotError(what, got=names, wanted=wanted)
        if len(floating) > 1 or (floating and not self._is_base(floating[0], root)):
            what = f"{self.where} has a floating joint that is not its base"
            wanted = "at most one, from a root link that carries nothing else"
            raise RobotError(what, got=names, wanted=wanted)
        if floating:
            self._take_out(root, floating[0])
            return self._root_link()
        if base == "floating" and root == WORLD:
            return self._freed()
        if base == "fixed" and root != WORLD:
            ET.SubElement(self.root, "link", name=WORLD)
            joint = ET.SubElement(self.root, "joint", name="world_weld", type="fixed")
            ET.SubElement(joint, "parent", link=WORLD)
            ET.SubElement(joint, "child", link=root)
        return root

    def _freed(self) -> str:
        """Take the link `world` from under a robot that is to float."""
        carried = [j for j in self._joints() if end_of(j, "parent") == WORLD]
        (world,) = (e for e in self.root.findall("link") if e.get("name") == WORLD)
        bare = world.find("inertial") is None
        if not bare or len(carried) != 1 or carried[0].get("type") != "fixed":
            raise RobotError(
                f"{self.where} has a root link {WORLD!r} that is part of the robot",
                got=[j.get("name") for j in carried],
                wanted="another name for this link, or one fixed joint from it to the robot",
            )
        self._take_out(WORLD, carried[0])
        return self._root_link()

    def _take_out(self, link: str, joint: ET.Element) -> None:
        self.root.remove(joint)
        for element in [e for e in self.root.findall("link") if e.get("name") == link]:
            self.root.remove(element)

    def _is_base(self, joint: ET.Element, root: str) -> bool:
        """True for a floating joint that is all that a root link without mass carries."""
        carried = [j for j in self._joints() if end_of(j, "parent") == root]
        links = [e for e in self.root.findall("link") if e.get("name") == root]
        return carried == [joint] and all(link.find("inertial") is None for link in links)

    def _root_link(self) -> str:
        joints = [(end_of(j, "parent"), end_of(j, "child")) for j in self._joints()]
        children = [child for _, child in joints]
        roots = [name for name in self.links() if name not in children]
        if len(roots) != 1:
            wanted = (
                "one link that no joint moves: a <joint> to each of the others, or these taken out"
            )
            raise RobotError(f"{self.where} has no single root link", got=roots, wanted=wanted)
        reached = list(roots)
        for link in reached:
            reached += [child for parent, child in joints if parent == link]
            if len(reached) > len(self.links()):
                break
        if sorted(reached) != sorted(self.links()):
            loose = sorted(name for name in self.links() if reached.count(name) != 1)
            wanted = "one joint from the root's side to each of these links"
            raise RobotError(f"{self.where} is not a tree of links", got=loose, wanted=wanted)
        return roots[0]

    def build(self, *, floating: bool) -> pin.Model:
        text = self.text
        name = free_name("root_joint", {e.get("name", "") for e in self.root.iter()})
        root = (pin.JointModelFreeFlyer(), name) if floating else ()
        with captured() as noise:
            try:
                return pin.buildModelFromXML(text, *root)
            except (ValueError, RuntimeError, IndexError) as error:
                reason = str(error) or type(error).__name__
        said = f" ({noise.text})" if noise.text else ""
        raise RobotError(f"{self.where} cannot be built: {reason}{said}") from None

    def meshes(self) -> dict[str, Path | None]:
        names = sorted({e.get("filename", "") for e in self.root.iter("mesh")})
        return {n: find_mesh(n, self.directory, self.package_dirs) for n in names}

    def drop_meshes(self, names: set[str]) -> list[str]:
        for link, shape in self._shapes():
            mesh = shape.find("geometry/mesh")
            if mesh is not None and mesh.get("filename", "") in names:
                link.remove(shape)
        return []

    def _shapes(self) -> Iterator[tuple[ET.Element, ET.Element]]:
        for link in self.root.findall("link"):
            for shape in [*link.findall("visual"), *link.findall("collision")]:
                yield link, shape

    def write_limits(self, limits: JointLimits) -> None:
        """Write limits by joint; a continuous joint becomes a hinge, and what it lacks is zero."""
        for joint in self._joints():
            if joint.get("type") not in _HINGES:
                continue
            name = joint.get("name", "")
            limit = joint.find("limit")
            if limit is None:
                limit = ET.SubElement(joint, "limit")
            if joint.get("type") == "continuous":
                joint.set("type", "revolute")
                limit.attrib.update(lower="0", upper="0")
            if name in limits.position:
                low, high = limits.position[name]
                limit.attrib.update(lower=repr(low), upper=repr(high))
            for key, values in (("velocity", limits.velocity), ("effort", limits.torque)):
                limit.set(key, repr(values.get(name, max(float(limit.get(key, "0")), 0.0))))

    def _write_inertia(self, inertial: ET.Element, inertia: Float64[np.ndarray, "3 3"]) -> None:
        for element in inertial.findall("inertia"):
            for key, (i, j) in zip(INERTIA, zip(*np.triu_indices(3), strict=True), strict=True):
                element.set(key, repr(float(inertia[i, j])))

    def endless(self) -> list[str]:
        """List joints that turn without end, and hinges without both limits."""
        return sorted(
            j.get("name", "")
            for j in self._joints()
            if j.get("type") == "continuous"
            or (j.get("type") == "revolute" and not any(map(j.findall, _ENDS)))
        )

    def _tidy(self) -> None:
        """Take out elements of other programs, and parts of shapes that MuJoCo refuses to read."""
        foreign = [e.tag.partition("}")[2] for e in self.root if _XACRO in e.tag.partition("}")[0]]
        if _SOURCE & {*foreign} or any(
            "${" in v for e in self.root.iter() for v in e.attrib.values()
        ):
            raise RobotError(
                f"{self.where} is a xacro file, which is not expanded",
                got=sorted({*foreign}),
                wanted="the suffix .xacro, which Poise expands with `pip install poise[xacro]`",
            )
        if foreign:
            self.remarks.append(f"macros that xacro left behind are left out: {few(foreign)}")
        for element in [e for e in self.root if e.tag not in _PARTS]:
            self.root.remove(element)
        coloured: list[str] = []
        seen: set[str] = set()
        for link, shape in self._shapes():
            for extra in shape.findall("material")[1:]:
                shape.remove(extra)
                coloured.append(link.get("name", ""))
            if _is_nothing(shape):
                link.remove(shape)
            elif (name := shape.get("name")) in seen:
                del shape.attrib["name"]
            elif name is not None:
                seen.add(name)
        if coloured:
            links = few(list(dict.fromkeys(coloured)))
            self.remarks.append(f"of several materials of a shape the first is taken: {links}")
        self.package_dirs += package_folders(self.root, self.directory)

    def _check(self) -> None:
        for element in (*self.root.findall("link"), *self._joints()):
            self._check_element(element)
        for link in self.root.findall("link"):
            self._check_inertial(link)
        for joint in self._joints():
            self._check_joint(joint)

    def _check_element(self, element: ET.Element) -> None:
        """Refuse elements that stand twice, and attributes without the numbers they need."""
        named = f"{element.tag} {element.get('name')!r}"
        for inner in element.iter():
            for tag in _SINGLE.get(inner.tag, ()):
                if len(inner.findall(tag)) > 1:
                    place = "" if inner is element else f" in <{inner.tag}>"
                    raise RobotError(
                        f"{self.where}: {named} has two <{tag}>{place}", wanted="one of them"
                    )
            for key, count in _COUNTS.get(inner.tag, {}).items():
                text = inner.get(key)
                if text is None:
                    continue
                words = text.split()
                if len(words) != count or not all(is_number(word) for word in words):
                    raise RobotError(
                        f"{self.where}: {key} in <{inner.tag}> of {named} "
                        f"is {'no number' if count == 1 else f'not {count} numbers'}",
                        got=text,
                        wanted="a finite number" if count == 1 else f"{count} finite numbers",
                    )

    def _check_inertial(self, link: ET.Element) -> None:
        """Pinocchio leaves out the mass of an <inertial> without inertia, which MuJoCo refuses."""
        inertial = link.find("inertial")
        tags = ["mass", "inertia"] if inertial is None else [part.tag for part in inertial]
        for tag in ("mass", "inertia"):
            if tag not in tags:
                raise RobotError(
                    f"{self.where}: the <inertial> of link {link.get('name')!r} has no <{tag}>",
                    got=", ".join(f"<{t}>" for t in tags) or "nothing in it",
                    wanted="both <mass> and <inertia>, or no <inertial>",
                )

    def _check_joint(self, joint: ET.Element) -> None:
        name, kind = joint.get("name"), joint.get("type", "")
        for tag in ("parent", "child"):
            if end_of(joint, tag) not in self.links():
                raise RobotError(
                    f"{self.where}: {tag} of joint {name!r} is no link",
                    got=end_of(joint, tag),
                    choices=self.links(),
                )
        if kind not in (*_HINGES, "fixed", "floating"):
            what = f"{self.where}: joint {name!r} is of a type that Poise has not"
            wanted = "revolute, continuous, prismatic or fixed, one for each degree of freedom"
            raise RobotError(what, got=kind, wanted=wanted)
        axis = joint.find("axis")
        text = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
        if kind in _HINGES and not math.hypot(*map(float, text.split())) > 0.0:
            what = f"{self.where}: the axis of joint {name!r} has no direction"
            wanted = 'three numbers that are not all zero, such as "0 1 0"'
            raise RobotError(what, got=text, wanted=wanted)
        mimic = joint.find("mimic")
        if mimic is not None and kind in _HINGES and mimic.get("joint") not in self.joints():
            raise UnknownNameError(
                f"{self.where}: joint {name!r} mimics a joint that does not exist",
                got=mimic.get("joint"),
                choices=self.joints(),
            )


def end_of(joint: ET.Element, tag: str) -> str:
    """The parent or child link of a joint; empty where it names none."""
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def crossed_limits(where: str, crossed: Mapping[str, tuple[float, float]]) -> RobotError:
    """The error for lower limits above upper ones [rad or m]."""
    said = (f"{name}: lower {low:g}, upper {high:g}" for name, (low, high) in crossed.items())
    return RobotError(
        f"{where} has joints whose lower limit is above the upper one",
        got="; ".join(said),
        wanted="lower below upper in the model file, or [lower, upper] under `limits.position` in "
        "its description",
    )


def _is_nothing(shape: ET.Element) -> bool:
    """True without a solid that MuJoCo reads, and for a primitive with a size of zero."""
    solid = shape.find("geometry/*")
    if solid is None or solid.tag not in _COUNTS:
        return True
    sizes = [] if solid.tag == "mesh" else [solid.get(key, "0") for key in _COUNTS[solid.tag]]
    return any(is_number(word) and float(word) <= 0.0 for text in sizes for word in text.split())
