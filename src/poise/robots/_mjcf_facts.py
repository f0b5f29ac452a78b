"""What an MJCF document says in the sections that a robot's own document lacks: `read_facts`."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.robots._document import Document
from poise.robots._mjcf_compile import mujoco_module, parse_mjcf, rotation_of
from poise.robots._mjcf_world import frames_around, placement_of, root_body


@dataclass(frozen=True, kw_only=True)
class MjcfFacts:
    """What an MJCF document says in the sections that are left out of a robot's own.

    Attributes:
        torque: largest torque or force by joint, from its actuators [N m, N].
        followers: joints that an equality ties to another joint.
        leaders: joints that another is tied to.
        loops: names of the equalities that close kinematic loops.
        springs: joints with a spring.
        free: whether the root body has a free joint.
        upright: world_R_base of the root body where the document puts it.
        poses: joint positions by keyframe [rad, m].
    """

    torque: dict[str, float]
    followers: tuple[str, ...]
    leaders: tuple[str, ...]
    loops: tuple[str, ...]
    springs: tuple[str, ...]
    free: bool
    upright: Float64[np.ndarray, "3 3"]
    poses: dict[str, dict[str, float]] = field(repr=False)


def read_facts(document: Document, directory: Path | None) -> MjcfFacts:
    """Read the sections of an MJCF document that `settle_mjcf` takes out of it.

    Args:
        document: the document with all its sections.
        directory: where its relative paths start.

    Raises:
        RobotError: MuJoCo cannot read the document, or it has no single root body that moves.
    """
    mujoco = mujoco_module(document.where)
    root = root_body(document)
    spec = parse_mjcf(document.root, directory, document.where)
    body = spec.body(root.get("name", ""))
    free = any(j.type == mujoco.mjtJoint.mjJNT_FREE for j in body.joints)
    poses, upright = _poses(mujoco, spec, body)
    equality, active = mujoco.mjtEq, [e for e in spec.equalities if e.active]
    return MjcfFacts(
        torque=_torques(mujoco, spec),
        followers=tuple(e.name1 for e in active if e.type == equality.mjEQ_JOINT),
        leaders=tuple(e.name2 for e in active if e.type == equality.mjEQ_JOINT and e.name2),
        loops=tuple(
            e.name or f"{e.name1} - {e.name2}"
            for e in active
            if e.type in (equality.mjEQ_CONNECT, equality.mjEQ_WELD) and e.name2
        ),
        springs=tuple(j.name for j in spec.joints if np.any(np.asarray(j.stiffness) != 0.0)),
        free=free,
        upright=_orientation(document, root) if upright is None else upright,
        poses=poses,
    )


def _orientation(document: Document, root: ET.Element) -> Float64[np.ndarray, "3 3"]:
    """How the root body stands in the world, whatever it and the frames around it are turned by."""
    alone = ET.Element("mujoco")
    for compiler in document.root.findall("compiler"):
        units = {k: v for k, v in compiler.attrib.items() if k in ("angle", "eulerseq")}
        ET.SubElement(alone, "compiler", units)
    place = ET.SubElement(alone, "worldbody")
    for frame in frames_around(document.root, root):
        place = ET.SubElement(place, "frame", placement_of(frame))
    ET.SubElement(place, "body", placement_of(root))
    compiled = parse_mjcf(alone, None, document.where).compile()
    return rotation_of(compiled.body_quat[1])


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
    # Not its truth: MuJoCo gives an enum, of which every member is true.
    return bool(flag == mujoco.mjtLimited.mjLIMITED_TRUE)


_QPOS_SIZE = {"FREE": 7, "BALL": 4}
"""Positions of a joint in MuJoCo's `qpos`; a hinge or slide has one."""


def _poses(
    mujoco: ModuleType, spec: Any, root: Any
) -> tuple[dict[str, dict[str, float]], Float64[np.ndarray, "3 3"] | None]:
    """Joint positions of each keyframe, and how the first of them turns a free base."""
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
