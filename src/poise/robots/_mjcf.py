"""MJCF read by MuJoCo's own compiler, which resolves defaults, classes, frames and geometry.

`settle_mjcf`: the document as the rest of Poise relies on it, and what its other sections say.
`build_mjcf_model`: the Pinocchio model of the bodies, joints and sites that MuJoCo compiles.
"""

import importlib
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import MissingExtraError, RobotError
from poise.robots._document import Document
from poise.robots._robot import ModelSource

_LEFT_OUT = (
    "actuator", "contact", "custom", "deformable", "equality", "keyframe", "option", "sensor",
    "size", "tendon",
)  # fmt: skip
"""Sections that the plant and the controller bring themselves, or that a `Robot` does not have."""

_SPRINGS = ("stiffness", "springref", "springdamper")
"""Attributes of joints that would push in the plant while the controller knows of no spring."""

_PLACEMENT = ("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler")
"""Attributes that place an MJCF body."""


@dataclass(frozen=True, kw_only=True)
class MjcfFacts:
    """What an MJCF document says in the sections that are left out of a robot's own.

    Attributes:
        torque: largest torque or force by joint, from its actuators [N m, N].
        followers: joints that an equality ties to another joint.
        loops: names of the equalities that close kinematic loops.
        springs: joints with a spring.
        free: whether the root body has a free joint.
        upright: world_R_base of the root body where the document puts it.
        poses: joint positions by keyframe [rad, m].
    """

    torque: dict[str, float]
    followers: tuple[str, ...]
    loops: tuple[str, ...]
    springs: tuple[str, ...]
    free: bool
    upright: Float64[np.ndarray, "3 3"]
    poses: dict[str, dict[str, float]] = field(repr=False)


def mujoco_module(where: str) -> ModuleType:
    """MuJoCo, which reads MJCF.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return importlib.import_module("mujoco")
    except ModuleNotFoundError:
        raise MissingExtraError("mujoco", "sim", f"Reading {where}, which is MJCF,") from None


def read_facts(document: Document, directory: Path | None) -> MjcfFacts:
    """Read the sections of an MJCF document that `settle_mjcf` takes out of it.

    Args:
        document: the document with all its sections.
        directory: where its relative paths start.

    Raises:
        RobotError: MuJoCo cannot read the document, or it has no single root body that moves.
    """
    mujoco = mujoco_module(document.where)
    root = _root_body(document)
    spec = _parse(document.root, directory, document.where)
    body = spec.body(root.get("name", ""))
    free = any(j.type == mujoco.mjtJoint.mjJNT_FREE for j in body.joints)
    poses, upright = _poses(mujoco, spec, body)
    equality = mujoco.mjtEq
    return MjcfFacts(
        torque=_torques(mujoco, spec),
        followers=tuple(e.name1 for e in spec.equalities if e.type == equality.mjEQ_JOINT),
        loops=tuple(
            e.name or f"{e.name1} - {e.name2}"
            for e in spec.equalities
            if e.type in (equality.mjEQ_CONNECT, equality.mjEQ_WELD) and e.name2
        ),
        springs=tuple(j.name for j in spec.joints if np.any(np.asarray(j.stiffness) != 0.0)),
        free=free,
        upright=upright,
        poses=poses,
    )


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
    root = _root_body(document)
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
    _keep_only(document.root, root, hoist=base == "floating")
    for tag in _LEFT_OUT:
        for element in document.root.findall(tag):
            document.root.remove(element)
    for joint in document.root.iter("joint"):
        for key in _SPRINGS:
            joint.attrib.pop(key, None)
    for body in document.root.iter("body"):
        body.attrib.pop("gravcomp", None)
    return root.get("name", "")


def build_mjcf_model(source: ModelSource, *, floating: bool, where: str) -> pin.Model:
    """Build the Pinocchio model of a settled MJCF document, with its armature and friction.

    Joints are in MuJoCo's order. A hinge turns its body about `pos` by q - `ref`; several joints of
    one body follow each other, as MuJoCo has them.

    Args:
        source: the document, settled.
        floating: whether a free joint is put before the root body.
        where: the file, for messages.

    Raises:
        RobotError: MuJoCo cannot compile it, or a joint has more than one degree of freedom.
    """
    mujoco, compiled = mujoco_module(where), _compile(source, where, set())
    return _Builder(mujoco, compiled, base_name(source.text) if floating else None, where).model


def base_name(text: str) -> str:
    """A name for the free joint before the root that a document's text has for nothing else."""
    name = "root_joint"
    while f'"{name}"' in text:
        name += "_"
    return name


def drop_mesh_geoms(root: ET.Element, files: set[str]) -> list[str]:
    """Take the pictures out of an MJCF document whose mesh files are not there.

    Args:
        root: the document's root element, changed in place.
        files: names of the missing files, as the document has them.

    Returns:
        Bodies without an inertia of their own that have lost a mesh their mass may come from.
    """
    meshes = [m for m in root.iter("mesh") if m.get("file") in files]
    names = {m.get("name") or Path(m.get("file", "")).stem for m in meshes}
    bare: list[str] = []
    for parent in list(root.iter()):
        gone = [g for g in parent if g.tag == "geom" and g.get("mesh") in names]
        for geom in gone:
            parent.remove(geom)
        if gone and parent.tag == "body" and parent.find("inertial") is None:
            bare.append(parent.get("name", ""))
        for mesh in meshes:
            if mesh in list(parent):
                parent.remove(mesh)
    return bare


def free_site_names(root: ET.Element, taken: set[str]) -> None:
    """Rename sites of an MJCF document that have the name of a role, which means the role."""
    for site in root.iter("site"):
        if site.get("name") in taken:
            site.set("name", f"{site.get('name')}_site")


def compile_geometry(source: ModelSource, bodies: set[str], where: str) -> Any:
    """MuJoCo's compiled model of a settled document, with the meshes of some bodies.

    Raises:
        RobotError: MuJoCo cannot compile it.
    """
    return _compile(source, where, bodies)


def _compile(source: ModelSource, where: str, pictured: set[str]) -> Any:
    mujoco = mujoco_module(where)
    spec = _parse(ET.fromstring(source.text), source.directory, where)
    spec.compiler.fusestatic = False
    spec.compiler.balanceinertia = False
    spec.compiler.boundmass, spec.compiler.boundinertia = 1e-12, 1e-14
    _drop_unread_meshes(mujoco, spec, pictured)
    try:
        return spec.compile()
    except ValueError as error:
        raise RobotError(f"MuJoCo cannot build {where}: {_one_line(error)}") from None


def _parse(root: ET.Element, directory: Path | None, where: str) -> Any:
    mujoco = mujoco_module(where)
    if directory is not None:
        root = ET.fromstring(ET.tostring(root, encoding="unicode"))
        # MuJoCo takes the last of several compiler sections for its folders.
        for compiler in root.findall("compiler") or [ET.SubElement(root, "compiler")]:
            folder = compiler.get("assetdir", "")
            for key in ("meshdir", "texturedir"):
                compiler.set(key, str(directory / compiler.get(key, folder)))
    try:
        return mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise RobotError(f"MuJoCo cannot read {where}: {_one_line(error)}") from None


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _root_body(document: Document) -> ET.Element:
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


def _keep_only(document: ET.Element, root: ET.Element, *, hoist: bool) -> None:
    """Take all other bodies out of the world; a floating root stands in it without a frame."""
    for world in document.findall("worldbody"):
        for place in [world, *_frames(world)]:
            for body in [b for b in place if b.tag == "body" and b is not root]:
                place.remove(body)
            if hoist and place is not world and root in list(place):
                place.remove(root)
                if place.get("childclass") and not root.get("childclass"):
                    root.set("childclass", place.get("childclass", ""))
                world.append(root)


def _frames(element: ET.Element) -> Iterator[ET.Element]:
    """The frames around bodies of the world, not those inside bodies."""
    for frame in element.findall("frame"):
        yield frame
        yield from _frames(frame)


def _torques(mujoco: ModuleType, spec: Any) -> dict[str, float]:
    """The largest force of each joint's actuators, where any of their ranges says so."""
    found: dict[str, float] = {}
    for motor in spec.actuators:
        joint_kinds = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
        if motor.trntype not in joint_kinds:
            continue
        force = _force_of(mujoco, motor)
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
    return bool(flag)


_QPOS_SIZE = {"FREE": 7, "BALL": 4}
"""Positions of a joint in MuJoCo's `qpos`; a hinge or slide has one."""


def _poses(
    mujoco: ModuleType, spec: Any, root: Any
) -> tuple[dict[str, dict[str, float]], Float64[np.ndarray, "3 3"]]:
    """Joint positions of each keyframe, and how the first of them, or the body, turns the base."""
    address: dict[str, int] = {}
    base, size = None, 0
    for body in spec.bodies:
        for joint in body.joints:
            kind = mujoco.mjtJoint(joint.type).name.removeprefix("mjJNT_")
            if kind == "FREE" and body.name == root.name:
                base = size
            elif kind not in _QPOS_SIZE:
                address[joint.name] = size
            size += _QPOS_SIZE.get(kind, 1)
    quaternion = np.array(root.quat, dtype=np.float64)
    poses: dict[str, dict[str, float]] = {}
    for number, key in enumerate(spec.keys):
        qpos = np.asarray(key.qpos, dtype=np.float64)
        if len(qpos) != size:
            continue
        if base is not None and not poses:
            quaternion = qpos[base + 3 : base + 7]
        poses[key.name or f"key{number}"] = {n: float(qpos[i]) for n, i in address.items()}
    return poses, _rotation(quaternion)


def _rotation(quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "3 3"]:
    """The rotation matrix of MuJoCo's quaternion (w, x, y, z)."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return pin.Quaternion(w, x, y, z).toRotationMatrix()


def _drop_unread_meshes(mujoco: ModuleType, spec: Any, pictured: set[str]) -> None:
    """Leave out the meshes that no inertia comes from: a controller reads no pictures."""
    if spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        return
    kinds = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
    kept: set[str] = set()
    for body in spec.bodies:
        for geom in [g for g in body.geoms if g.meshname]:
            unread = body.explicitinertial or body.name == "world"
            if geom.type in kinds and unread and body.name not in pictured:
                spec.delete(geom)
            else:
                kept.add(geom.meshname)
    for mesh in [m for m in spec.meshes if (m.name or Path(m.file).stem) not in kept]:
        spec.delete(mesh)


class _Builder:
    """Pinocchio's model, body by body in MuJoCo's order."""

    def __init__(self, mujoco: ModuleType, compiled: Any, base: str | None, where: str) -> None:
        self._mujoco, self._compiled, self._where = mujoco, compiled, where
        self.model = pin.Model()
        self._joint_of = {0: 0}
        """Pinocchio's joint that moves each body."""
        self._placement = {0: pin.SE3.Identity()}
        """Of each body in that joint."""
        self._frame_of = {0: 0}
        if base is not None:
            self._joint_of[0] = self._add(base, 0, pin.JointModelFreeFlyer(), None)
        armature, damping, friction = {}, {}, {}
        for body in range(1, compiled.nbody):
            for joint in self._add_body(body):
                name, dof = compiled.joint(joint).name, int(compiled.jnt_dofadr[joint])
                armature[name] = float(compiled.dof_armature[dof])
                damping[name] = float(np.ravel(compiled.dof_damping[dof])[0])
                friction[name] = float(compiled.dof_frictionloss[dof])
        self._set_by_joint(armature, damping, friction)
        for site in range(compiled.nsite):
            self._add_site(site)

    def _add(self, name: str, parent: int, joint: Any, placement: pin.SE3 | None) -> int:
        start = pin.SE3.Identity() if placement is None else placement
        index = self.model.addJoint(parent, joint, start, name)
        self.model.addJointFrame(index, -1)
        return int(index)

    def _add_body(self, body: int) -> list[int]:
        compiled = self._compiled
        above = int(compiled.body_parentid[body])
        moved_by = self._joint_of[above]
        here = self._placement[above] * _pose(compiled.body_pos[body], compiled.body_quat[body])
        first = int(compiled.body_jntadr[body])
        joints = list(range(first, first + int(compiled.body_jntnum[body])))
        for joint in joints:
            moved_by, here = self._add_joint(joint, moved_by, here)
        self._joint_of[body], self._placement[body] = moved_by, here
        inertia = pin.Inertia(
            float(compiled.body_mass[body]), np.zeros(3), np.diag(compiled.body_inertia[body])
        )
        principal = _pose(compiled.body_ipos[body], compiled.body_iquat[body])
        self.model.appendBodyToJoint(moved_by, inertia, here * principal)
        name = compiled.body(body).name
        self._frame_of[body] = int(
            self.model.addBodyFrame(name, moved_by, here, self._frame_of[above])
        )
        return joints

    def _add_joint(self, joint: int, parent: int, here: pin.SE3) -> tuple[int, pin.SE3]:
        compiled, kinds = self._compiled, self._mujoco.mjtJoint
        name, kind = compiled.joint(joint).name, compiled.jnt_type[joint]
        axis = np.array(compiled.jnt_axis[joint], dtype=np.float64)
        anchor = pin.SE3(np.eye(3), np.array(compiled.jnt_pos[joint], dtype=np.float64))
        reference = -float(compiled.qpos0[compiled.jnt_qposadr[joint]])
        if kind == kinds.mjJNT_HINGE:
            model = pin.JointModelRevoluteUnaligned(axis)
            zero = pin.SE3(pin.exp3(reference * axis), np.zeros(3))
        elif kind == kinds.mjJNT_SLIDE:
            model = pin.JointModelPrismaticUnaligned(axis)
            zero = pin.SE3(np.eye(3), reference * axis)
        else:
            raise RobotError(
                f"joint {name!r} of {self._where} has the wrong type",
                got=kinds(kind).name,
                wanted="a hinge or slide with one position variable",
            )
        index = self._add(name, parent, model, here * anchor * zero)
        low, high = compiled.jnt_range[joint]
        limited, place = bool(compiled.jnt_limited[joint]), self.model.joints[index].idx_q
        self.model.lowerPositionLimit[place] = low if limited else -np.inf
        self.model.upperPositionLimit[place] = high if limited else np.inf
        dof = self.model.joints[index].idx_v
        self.model.velocityLimit[dof] = np.inf
        forced = bool(compiled.jnt_actfrclimited[joint])
        force = float(np.abs(compiled.jnt_actfrcrange[joint]).max()) if forced else np.inf
        self.model.effortLimit[dof] = force
        return index, anchor.inverse()

    def _add_site(self, site: int) -> None:
        compiled = self._compiled
        body = int(compiled.site_bodyid[site])
        name = compiled.site(site).name
        if not name or self.model.existFrame(name):
            return
        place = self._placement[body] * _pose(compiled.site_pos[site], compiled.site_quat[site])
        kind = pin.FrameType.OP_FRAME
        self.model.addFrame(
            pin.Frame(name, self._joint_of[body], self._frame_of[body], place, kind), False
        )

    def _set_by_joint(
        self,
        armature: Mapping[str, float],
        damping: Mapping[str, float],
        friction: Mapping[str, float],
    ) -> None:
        # Only once all joints are there: adding one makes these vectors anew.
        model = self.model
        for joint, name in zip(model.joints, model.names, strict=True):
            if name in armature:
                model.armature[joint.idx_v] = armature[name]
                model.damping[joint.idx_v] = damping[name]
                model.upperDryFrictionLimit[joint.idx_v] = friction[name]
                model.lowerDryFrictionLimit[joint.idx_v] = -friction[name]


def _pose(position: Float64[np.ndarray, "3"], quaternion: Float64[np.ndarray, "4"]) -> pin.SE3:
    return pin.SE3(_rotation(np.asarray(quaternion)), np.array(position, dtype=np.float64))
