"""MJCF: the robot in a document, facts of the sections around it, and what is taken out."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import few
from poise._yaml import read_text
from poise.errors import RobotError
from poise.robots._document import BLANK, Base, Coupling, Document, Facts, free_name
from poise.robots._mjcf_compile import (
    asset_folder,
    compile_mjcf,
    mujoco_module,
    parse_mjcf,
    rotation_of,
)
from poise.robots._mjcf_model import build_mjcf_model
from poise.robots._mjcf_write import mjcf_of

_LEFT_OUT = (
    "actuator", "contact", "custom", "deformable", "equality", "keyframe", "option", "sensor",
    "size", "tendon",
)  # fmt: skip
"""Sections replaced by the plant and the controller, or without a counterpart in `Robot`."""

_MACROS = ("replicate//body", "attach")
"""Elements of which MuJoCo makes bodies with names of its own."""

_NAN = frozenset({"nan", "-nan", "+nan"})
_SPRINGS = ("stiffness", "springref", "springdamper")
"""Attributes of springs, which a plant would have and a controller's model has not."""

_PLACEMENT = ("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler")
"""Attributes that place an MJCF body."""

_BASE, _CARRIED, _GROUND = "base", ("body", "frame", "geom", "site"), ("plane", "hfield")
"""The body that stands for a world from which limbs hang, what it holds, and what it does not."""

_QPOS_SIZE = {"FREE": 7, "BALL": 4}
"""Positions of a joint in MuJoCo's `qpos`; a hinge or slide has one."""


class MjcfDocument(Document):
    """An MJCF document."""

    kind = "mjcf"
    link_tag = "body"

    def joints(self) -> tuple[str, ...]:
        joints = self.root.iterfind("worldbody//joint")
        return tuple(j.get("name", "") for j in joints if j.get("type") != "free")

    def _tidy(self) -> None:
        _include(self.root, [self.directory or Path()], self.where)
        self._check_numbers()
        if any(self.root.find(f".//{tag}") is not None for tag in _MACROS):
            for model in self.root.iterfind("asset/model[@file]"):
                model.set("file", str((self.directory or Path()) / model.get("file", "")))
            self.root = ET.fromstring(mjcf_of(parse_mjcf(self.root, self.directory, self.where)))
        _name_all(self.root)

    def _check_numbers(self) -> None:
        """Refuse NaN, which MuJoCo takes for a value that is not given, and logs to a file."""
        names = {element.get("name") for element in self.root.iter()}
        for element in self.root.iter():
            for key, text in element.items():
                if _NAN & {*text.lower().split()} and text not in names:
                    what = f"{key} in <{element.tag}> {element.get('name', '')!r} is NaN"
                    raise RobotError(f"{self.where}: {what}", got=text, wanted="numbers")

    def _check(self) -> None:
        """Refuse ball joints; those that a class makes MuJoCo finds."""
        for joint in self.root.iterfind("worldbody//joint"):
            if joint.get("type") == "ball":
                what = f"{self.where}: joint {joint.get('name')!r} is a ball joint"
                wanted = "three hinges in its place"
                raise RobotError(what, got="three degrees of freedom", wanted=wanted)

    @cached_property
    def _robot(self) -> ET.Element:
        """The robot's root body: that with a free joint, the only one that moves, or a new one.

        Bodies without joints are scenery, and so are those with nothing but a free joint. Where
        several limbs hang from the world, a new body stands for it.
        """
        bodies = [b for w in self.root.findall("worldbody") for b in _bodies(w)]
        moving = [b for b in bodies if any(j.get("type") != "free" for j in b.iter("joint"))]
        free = [b for b in moving if _free_joints(b)]
        others = [b.get("name", "") for b in moving if free and b not in free]
        if not moving or len(free) > 1:
            raise RobotError(
                f"{self.where} has {'several robots' if moving else 'nothing that moves'}",
                got=[b.get("name") for b in (free or bodies)],
                wanted="one body with joints under <worldbody>, or one with a free joint",
            )
        if others:
            self.remarks.append(f"bodies beside the robot are left out: {few(others)}")
        if free or len(moving) == 1:
            return (free or moving)[0]
        names = [b.get("name", "") for b in moving]
        self.remarks.append(f"the world is the base, from which several limbs hang: {few(names)}")
        base = ET.Element("body", name=free_name(_BASE, self.links()))
        for world in self.root.findall("worldbody"):
            parts = [c for c in world if c.tag in _CARRIED and c.get("type") not in _GROUND]
            base.extend([c for c in parts if not _free_joints(c)])
            world[:] = []
        self.root.findall("worldbody")[0].append(base)
        return base

    def _read_facts(self) -> Facts:
        mujoco, robot = mujoco_module(self.where), self._robot
        spec = parse_mjcf(self.root, self.directory, self.where)
        poses, upright = _poses(mujoco, spec, robot.get("name", ""))
        kinds, active = mujoco.mjtEq, [e for e in spec.equalities if e.active]
        coupled = [e for e in active if e.type == kinds.mjEQ_JOINT]
        loops = [
            e.name or f"{e.name1} - {e.name2}"
            for e in active
            if e.type in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD) and e.name2
        ]
        springs = [j.name for j in spec.joints if np.any(np.asarray(j.stiffness) != 0.0)]
        left_out = {
            "loops that these equalities close are left open": loops,
            "springs are left out": springs,
            "tendons are left out": [t.name for t in spec.tendons],
            "couplings are taken as linear": [e.name1 for e in coupled if np.any(e.data[2:5])],
        }
        return Facts(
            fixed=not _free_joints(robot),
            free=bool(_free_joints(robot)),
            upright=_orientation(mujoco, spec, robot) if upright is None else upright,
            poses=poses,
            torque=_torques(mujoco, spec),
            couplings=tuple(
                # Without a second joint an equality holds the first one where it is.
                Coupling(e.name1, e.name2, float(e.data[0]), float(e.data[1]) if e.name2 else 0.0)
                for e in coupled
            ),
            remarks=tuple(f"{said}: {few(names)}" for said, names in left_out.items() if names),
        )

    def settle(self, base: Base) -> str:
        robot, floating = self._robot, base == "floating"
        free = _free_joints(robot)
        if free and not floating:
            what = f"{self.where} has a free joint, which contradicts a fixed base"
            wanted = "base: floating in its description, with the soles it stands on"
            raise RobotError(what, got=robot.get("name"), wanted=wanted)
        for joint in free:
            robot.remove(joint)
        if floating:
            for key in _PLACEMENT:
                robot.attrib.pop(key, None)
        self._take_out_scenery(robot, floating=floating)
        return robot.get("name", "")

    def _take_out_scenery(self, robot: ET.Element, *, floating: bool) -> None:
        """Leave the robot's bodies; sites beside a fixed root are frames that tasks may name."""
        for tag in _LEFT_OUT:
            for element in self.root.findall(tag):
                self.root.remove(element)
        for joint in self.root.iter("joint"):
            for key in _SPRINGS:
                joint.attrib.pop(key, None)
        for body in self.root.iter("body"):
            body.attrib.pop("gravcomp", None)
        kept = () if floating else ("site",)
        for world in self.root.findall("worldbody"):
            frames = _frames_in(world, robot)
            for place in [world, *frames]:
                own = [c for c in place if c is robot or c in frames or c.tag in kept]
                place[:] = own
            if floating and frames:
                classes = (e.get("childclass") for e in (robot, *reversed(frames)))
                if nearest := next(filter(None, classes), None):
                    robot.set("childclass", nearest)
                world[:] = [robot]
        bodies = {body.get("name") for body in self.root.iter("body")}
        for parent in list(self.root.iter()):
            for child in [c for c in parent if c.tag in ("light", "camera")]:
                if child.get("target") not in (None, *bodies):
                    parent.remove(child)

    def build(self, *, floating: bool) -> pin.Model:
        compiled = compile_mjcf(self.source(), self.where)
        return build_mjcf_model(compiled, floating=floating, where=self.where)

    def mend_inertias(self) -> list[str]:
        balanced = any(c.get("balanceinertia") == "true" for c in self.root.iter("compiler"))
        return [] if balanced else super().mend_inertias()

    def _write_inertia(self, inertial: ET.Element, inertia: Float64[np.ndarray, "3 3"]) -> None:
        count, key = (6, "fullinertia") if "fullinertia" in inertial.attrib else (3, "diaginertia")
        rows, columns = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
        inertial.set(key, " ".join(map(repr, inertia[rows, columns].tolist()[:count])))

    def free_names(self, taken: set[str]) -> None:
        sites = {site.get("name", ""): site for site in self.root.iterfind("worldbody//site")}
        for name in taken & sites.keys():
            sites[name].set("name", free_name(f"{name}_site", sites))

    def meshes(self) -> dict[str, Path | None]:
        said = [c.get("strippath") for c in self.root.findall("compiler") if c.get("strippath")]
        strip, folder = said[-1:] == ["true"], asset_folder(self.root, "meshdir")
        names = {n for e in self.root.iter("mesh") if (n := e.get("file"))}
        places = {n: folder / (Path(n).name if strip else n) for n in sorted(names)}
        if self.directory is not None:
            places = {name: self.directory / place for name, place in places.items()}
        return {name: place if place.is_file() else None for name, place in places.items()}

    def drop_meshes(self, names: set[str]) -> list[str]:
        meshes = [m for m in self.root.iter("mesh") if m.get("file") in names]
        lost = {m.get("name") or Path(m.get("file", "")).stem for m in meshes}
        lighter = self._weighed_by(lost)
        for parent in list(self.root.iter()):
            for child in list(parent):
                if child in meshes or (child.tag == "geom" and child.get("mesh") in lost):
                    parent.remove(child)
        return lighter

    def _weighed_by(self, meshes: set[str]) -> list[str]:
        """Bodies whose mass comes from one of some meshes, with MuJoCo's classes and options."""
        mujoco, spec = mujoco_module(self.where), parse_mjcf(self.root, self.directory, self.where)
        sources, options = mujoco.mjtInertiaFromGeom, spec.compiler
        low, high = options.inertiagrouprange
        automatic = options.inertiafromgeom == sources.mjINERTIAFROMGEOM_AUTO
        weighed: list[str] = []
        for body in spec.bodies:
            if body.explicitinertial and automatic:
                continue
            if options.inertiafromgeom == sources.mjINERTIAFROMGEOM_FALSE:
                continue
            lost = [g for g in body.geoms if g.meshname in meshes and low <= g.group <= high]
            # A mass that is not given is not a number, and follows from the density.
            if any((g.density if np.isnan(g.mass) else g.mass) > 0.0 for g in lost):
                weighed.append(body.name)
        return weighed


def _free_joints(body: ET.Element) -> list[ET.Element]:
    return [j for j in body if j.tag == "freejoint" or j.get("type") == "free"]


def _bodies(element: ET.Element) -> Iterator[ET.Element]:
    for child in element:
        if child.tag == "body":
            yield child
        elif child.tag == "frame":
            yield from _bodies(child)


def _frames_in(place: ET.Element, body: ET.Element) -> list[ET.Element]:
    """Frames around a body, outermost first."""
    for frame in place.findall("frame"):
        if body in list(frame):
            return [frame]
        if inner := _frames_in(frame, body):
            return [frame, *inner]
    return []


def _orientation(mujoco: ModuleType, spec: Any, robot: ET.Element) -> Float64[np.ndarray, "3 3"]:
    """Orientation of the root body in the world, with the frames around it."""
    place, rotation, given = spec.body(robot.get("name")), np.eye(3), mujoco.mjtOrientation
    while place is not None:
        quat = place.quat
        if place.alt.type != given.mjORIENTATION_QUAT:
            compiler = spec.compiler
            quat = spec.resolve_orientation(compiler.degree, compiler.eulerseq, place.alt)
        rotation = rotation_of(np.array(quat)) @ rotation
        place = place.frame
    return rotation


def _torques(mujoco: ModuleType, spec: Any) -> dict[str, float]:
    """Return the largest force of each joint's actuators with a range."""
    found: dict[str, float] = {}
    for motor in spec.actuators:
        joint_kinds = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
        force = _force_of(mujoco, motor) if motor.trntype in joint_kinds else None
        if force is not None:
            found[motor.target] = found.get(motor.target, 0.0) + force
    return found


def _force_of(mujoco: ModuleType, motor: Any) -> float | None:
    """Gear times the tighter of the force's range and, for a plain motor, the control's."""
    gear = abs(float(motor.gear[0]))
    sizes: list[float] = []
    if _limited(mujoco, motor.forcelimited, motor.forcerange):
        sizes.append(float(np.abs(motor.forcerange).max()))
    plain = (
        motor.gaintype == mujoco.mjtGain.mjGAIN_FIXED
        and motor.biastype == mujoco.mjtBias.mjBIAS_NONE
    )
    if plain and _limited(mujoco, motor.ctrllimited, motor.ctrlrange):
        sizes.append(abs(float(motor.gainprm[0])) * float(np.abs(motor.ctrlrange).max()))
    return gear * min(sizes) if sizes and min(sizes) * gear > 0.0 else None


def _limited(mujoco: ModuleType, flag: Any, span: Float64[np.ndarray, "2"]) -> bool:
    if flag == mujoco.mjtLimited.mjLIMITED_AUTO:
        return bool(span[0] < span[1])
    # Not its truth: MuJoCo gives an enum, of which every member is true.
    return bool(flag == mujoco.mjtLimited.mjLIMITED_TRUE)


def _poses(
    mujoco: ModuleType, spec: Any, root: str
) -> tuple[dict[str, dict[str, float]], Float64[np.ndarray, "3 3"] | None]:
    """Joint positions of each keyframe, and how the first of them turns a free base."""
    address: dict[str, int] = {}
    base, size = None, 0
    for body in spec.bodies:
        for joint in body.joints:
            kind = mujoco.mjtJoint(joint.type).name.removeprefix("mjJNT_")
            if kind == "FREE" and body.name == root:
                base = size
            elif kind not in _QPOS_SIZE:
                address[joint.name] = size
            size += _QPOS_SIZE.get(kind, 1)
    upright = None
    poses: dict[str, dict[str, float]] = {}
    for number, key in enumerate(spec.keys):
        qpos = np.asarray(key.qpos, dtype=np.float64)
        if len(qpos) != size:
            continue
        if base is not None and not poses:
            upright = rotation_of(qpos[base + 3 : base + 7])
        poses[key.name or f"key{number}"] = {n: float(qpos[i]) for n, i in address.items()}
    return poses, upright


def _include(
    element: ET.Element, folders: Sequence[Path], where: str, around: Sequence[Path] = ()
) -> None:
    """Put the content of files, sought from the first folder on, in the place of each <include>."""
    for index, child in reversed(list(enumerate(element))):
        if child.tag != "include":
            _include(child, folders, where, around)
            continue
        paths = [folder / child.get("file", "") for folder in folders]
        path = next((path for path in paths if path.is_file()), paths[0]).resolve()
        if path in around or not path.is_file():
            wrong = "includes it" if path in around else "cannot be found"
            what = f"a file included by {where} {wrong}"
            wanted = "the file at that place, or the <include> taken out"
            raise RobotError(what, got=str(path), wanted=wanted)
        try:
            included = ET.fromstring(read_text(path, error=RobotError).lstrip(BLANK))
        except ET.ParseError as error:
            raise RobotError(f"{path} is not valid XML: {error}") from None
        _include(included, [*folders, path.parent], path.name, [*around, path])
        element.remove(child)
        for k, inner in enumerate(included):
            element.insert(index + k, inner)


def _name_all(root: ET.Element) -> None:
    """Name the bodies and joints that a document leaves without a name."""
    bodies = {b.get("name", "") for b in root.iterfind("worldbody//body")}
    joints = {j.get("name", "") for j in root.iterfind("worldbody//joint")}
    for number, body in enumerate(root.findall("worldbody//body")):
        if not body.get("name"):
            _name(body, f"body{number + 1}", bodies)
        hinges = [j for j in _own(body, "joint") if not (j.get("name") or j.get("type") == "free")]
        for k, joint in enumerate(hinges):
            number_of_it = k + 1 if len(hinges) > 1 else ""
            _name(joint, f"{body.get('name')}_joint{number_of_it}", joints)


def _name(element: ET.Element, name: str, taken: set[str]) -> None:
    element.set("name", free_name(name, taken))
    taken.add(element.get("name", ""))


def _own(body: ET.Element, tag: str) -> Iterator[ET.Element]:
    """Elements of a body itself, also where frames of the document stand around them."""
    for child in body:
        if child.tag == tag:
            yield child
        elif child.tag == "frame":
            yield from _own(child, tag)
