"""The Pinocchio model of a robot's document: kinematics and inertias, no geometry.

Joint limits that a description gives in place of the document's, and the check of all limits.
"""

import math
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from poise.errors import RobotError, UnknownNameError
from poise.robots._description import Description, match_joints
from poise.robots._robot import FrameRole, ModelSource


@dataclass(frozen=True, kw_only=True)
class JointLimits:
    """Limits by joint, for the joints whose limits the description gives.

    Attributes:
        position: lower and upper limit [rad].
        velocity: largest speed [rad/s].
        torque: largest torque [N m].
    """

    position: dict[str, tuple[float, float]]
    velocity: dict[str, float]
    torque: dict[str, float]


def described_limits(facts: Description, joints: tuple[str, ...]) -> JointLimits:
    """Match the patterns of a description with the joints of a document.

    Raises:
        RobotError: a pattern matches no joint.
    """
    where = f"{facts.where}: limits"
    return JointLimits(
        position=match_joints(facts.limits.position, joints, f"{where}.position"),
        velocity=match_joints(facts.limits.velocity, joints, f"{where}.velocity"),
        torque=match_joints(facts.limits.torque, joints, f"{where}.torque"),
    )


def apply_limits(model: pin.Model, limits: JointLimits) -> None:
    """Put limits into a model, whose document may not hold them.

    Args:
        model: the model, changed in place.
        limits: the limits.
    """
    for joint, name in zip(model.joints, model.names, strict=True):
        if name in limits.position:
            low, high = limits.position[name]
            model.lowerPositionLimit[joint.idx_q] = low
            model.upperPositionLimit[joint.idx_q] = high
        if name in limits.velocity:
            model.velocityLimit[joint.idx_v] = limits.velocity[name]
        if name in limits.torque:
            model.effortLimit[joint.idx_v] = limits.torque[name]


def check_limits(model: pin.Model, *, floating: bool, where: str) -> None:
    """Check that every joint has limits that leave it room to move.

    Args:
        model: the model.
        floating: whether its first joint is a free base.
        where: the file or the robot's name, for messages.

    Raises:
        RobotError: limits are missing, zero, infinite or crossed; the message says whose.
    """
    lacking: dict[str, list[str]] = {"position": [], "velocity": [], "torque": []}
    for joint, name in list(zip(model.joints, model.names, strict=True))[2 if floating else 1 :]:
        low = float(model.lowerPositionLimit[joint.idx_q])
        high = float(model.upperPositionLimit[joint.idx_q])
        if not (low < high and _is_size(high - low)):
            lacking["position"].append(name)
        if not _is_size(float(model.velocityLimit[joint.idx_v])):
            lacking["velocity"].append(name)
        if not _is_size(float(model.effortLimit[joint.idx_v])):
            lacking["torque"].append(name)
    missing = {f"limits.{kind}": names for kind, names in lacking.items() if names}
    if missing:
        raise RobotError(
            f"{where} has joints whose limits are zero or missing",
            got=missing,
            wanted="these limits in the model file, or under `limits` in its description",
        )


def _is_size(value: float) -> bool:
    """Positive and finite; Pinocchio writes the largest float where nothing is given."""
    return 0.0 < value < 1e300 and math.isfinite(value)


_MIN_INERTIA = 1e-9
"""Smallest eigenvalue of the mass matrix that still counts as a mass [kg or kg m^2]."""

_PART_OF_MOTION = 0.1
"""Joints with a smaller part in a unit motion are not named."""


def build_model(
    source: ModelSource, *, floating: bool, armature: Mapping[str, float], where: str
) -> pin.Model:
    """Build the model of a document, with its locked joints welded at zero.

    Args:
        source: the document, in the form of `poise.robots.document`.
        floating: whether a free joint is put before the root link.
        armature: reflected rotor inertia by joint [kg m^2].
        where: the file or the robot's name, for messages.

    Returns:
        The model.

    Raises:
        RobotError: Pinocchio cannot build it, or a joint has more than one degree of freedom.
    """
    try:
        model = _parse(source, floating)
    except (ValueError, RuntimeError, IndexError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RobotError(f"{where} cannot be built: {reason}") from None
    locked = [model.getJointId(name) for name in source.locked_joints]
    if locked:
        model = pin.buildReducedModel(model, locked, pin.neutral(model))
    for joint in list(model.joints)[2 if floating else 1 :]:
        if (joint.nq, joint.nv) != (1, 1):
            raise RobotError(
                f"joint {model.names[joint.id]!r} of {where} has the wrong type",
                got=joint.shortname(),
                wanted="a hinge or slide with one position variable",
            )
    model.armature = np.zeros(model.nv)
    for name, value in armature.items():
        model.armature[model.joints[model.getJointId(name)].idx_v] = value
    return model


def add_roles(model: pin.Model, roles: Mapping[str, FrameRole], where: str) -> None:
    """Add the frames with a part to play under their own names.

    A frame of the document that already has such a name gets `_link` or `_joint` appended, so that
    the name means the role.

    Args:
        model: the model, changed in place.
        roles: the frames.
        where: the file or the robot's name, for messages.

    Raises:
        UnknownNameError: the link of a role does not exist.
    """
    bodies = {f.name: i for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
    for role in roles.values():
        if role.link not in bodies:
            raise UnknownNameError(
                f"{where}: the link that should carry {role.name!r} does not exist",
                got=role.link,
                choices=bodies,
            )
    _free_names(model, set(roles))
    for role in roles.values():
        index = bodies[role.link]
        link = model.frames[index]
        placement = link.placement * pin.SE3(role.rotation, role.position)
        frame = pin.Frame(role.name, link.parentJoint, index, placement, pin.FrameType.OP_FRAME)
        model.addFrame(frame, False)


def check_inertia(model: pin.Model, where: str) -> None:
    """Check that every joint moves some mass, and that no motion is free of inertia.

    A joint without rotational inertia behind it is let through where it has a rotor inertia.

    Args:
        model: the model.
        where: the file or the robot's name, for messages.

    Raises:
        RobotError: a moving part weighs nothing, or the mass matrix is not positive definite.
    """
    data = model.createData()
    pin.computeSubtreeMasses(model, data)
    names = list(model.names)
    light = [names[i] for i in range(1, model.njoints) if data.mass[i] <= 0.0]
    if light:
        raise RobotError(
            f"{where} has moving links without mass",
            got=light,
            wanted="an <inertial> with a positive mass behind each of these joints",
        )
    pin.crba(model, data, pin.neutral(model))
    mass = np.triu(data.M) + np.triu(data.M, 1).T
    values, vectors = np.linalg.eigh(mass)
    if values[0] > _MIN_INERTIA:
        return
    still = {
        names[i]
        for i in range(1, model.njoints)
        if np.abs(vectors[model.joints[i].idx_v, 0]) > _PART_OF_MOTION
    }
    raise RobotError(
        f"{where} can move without inertia",
        got=sorted(still),
        wanted="positive inertias behind these joints, or an armature in the description",
    )


def _parse(source: ModelSource, floating: bool) -> pin.Model:
    if source.kind == "urdf":
        root = (pin.JointModelFreeFlyer(),) if floating else ()
        return pin.buildModelFromXML(source.text, *root)
    # Pinocchio reads MJCF from files only, and looks for meshes beside them.
    with tempfile.NamedTemporaryFile("w", suffix=".xml", encoding="utf-8") as file:
        file.write(_with_absolute_folders(source))
        file.flush()
        if floating:
            return pin.buildModelFromMJCFAndRootJoint(file.name, pin.JointModelFreeFlyer())
        return pin.buildModelFromMJCF(file.name)


def _with_absolute_folders(source: ModelSource) -> str:
    if source.directory is None:
        return source.text
    root = ET.fromstring(source.text)
    for compiler in root.findall("compiler") or [ET.SubElement(root, "compiler")]:
        folder = compiler.get("assetdir", "")
        for key in ("meshdir", "texturedir"):
            compiler.set(key, str(source.directory / compiler.get(key, folder)))
    return ET.tostring(root, encoding="unicode")


def _free_names(model: pin.Model, names: set[str]) -> None:
    taken = {f.name for f in model.frames} | names
    for frame in model.frames:
        if frame.name not in names:
            continue
        suffix = "_link" if frame.type == pin.FrameType.BODY else "_joint"
        name = frame.name + suffix
        while name in taken:
            name += "_"
        frame.name = name
        taken.add(name)
