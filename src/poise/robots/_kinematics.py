"""The Pinocchio model of a robot's document: kinematics and inertias, no geometry."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from poise.errors import RobotError, UnknownNameError
from poise.robots._mjcf import base_name, build_mjcf_model
from poise.robots._noise import captured
from poise.robots._robot import FrameRole, ModelSource

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
        armature: reflected rotor inertia by joint [kg m^2], in place of an MJCF document's own.
        where: the file or the robot's name, for messages.

    Returns:
        The model.

    Raises:
        RobotError: Pinocchio cannot build it, or a joint has more than one degree of freedom.
    """
    if source.kind == "urdf":
        model = _parse_urdf(source, floating, where)
    else:
        model = build_mjcf_model(source, floating=floating, where=where)
    locked = [model.getJointId(name) for name in source.locked_joints]
    if locked:
        model = _welded(model, locked)
    for joint in list(model.joints)[2 if floating else 1 :]:
        if (joint.nq, joint.nv) != (1, 1):
            raise RobotError(
                f"joint {model.names[joint.id]!r} of {where} has the wrong type",
                got=joint.shortname(),
                wanted="a hinge or slide with one position variable",
            )
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
            wanted="an <inertial> with a positive mass behind each of these joints, or those "
            "joints under `locked` in the description",
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


def _parse_urdf(source: ModelSource, floating: bool, where: str) -> pin.Model:
    root = (pin.JointModelFreeFlyer(), base_name(source.text)) if floating else ()
    with captured() as noise:
        try:
            return pin.buildModelFromXML(source.text, *root)
        except (ValueError, RuntimeError, IndexError) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
    said = f" ({noise.text})" if noise.text else ""
    raise RobotError(f"{where} cannot be built: {reason}{said}") from None


def _welded(model: pin.Model, joints: list[int]) -> pin.Model:
    """The model without some joints, at zero; what each other joint has of its own stays its."""
    armature = {n: model.armature[j.idx_v] for n, j in hinges(model)}
    model = pin.buildReducedModel(model, joints, pin.neutral(model))
    for name, joint in hinges(model):
        model.armature[joint.idx_v] = armature[name]
    return model


def hinges(model: pin.Model) -> list[tuple[str, pin.JointModel]]:
    """Names and joints of a model, without the world and a free base."""
    joints = list(zip(model.names, model.joints, strict=True))[1:]
    return [(name, joint) for name, joint in joints if joint.nv == 1]


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
