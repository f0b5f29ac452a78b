"""Frames with a part to play in a Pinocchio model, and the check of its inertias."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from poise.errors import RobotError, UnknownNameError
from poise.robots._robot import FrameRole

_MIN_INERTIA = 1e-9
"""Smallest eigenvalue of the mass matrix that still counts as a mass [kg or kg m^2]."""

_PART_OF_MOTION = 0.1
"""Joints with a smaller part in a unit motion are not named."""


def add_roles(model: pin.Model, roles: Mapping[str, FrameRole], where: str) -> None:
    """Add the frames with a part to play under their own names.

    A frame of the document that already has such a name gets `_link` or `_joint` appended, so that
    the name means the role.
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
