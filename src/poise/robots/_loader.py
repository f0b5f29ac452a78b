"""`load_robot`: from a name or a model to a `Robot`."""

import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._yaml import read_text, read_yaml
from poise.errors import RobotError, UnknownNameError
from poise.robots._assembly import assemble
from poise.robots._catalog import catalog_names, find_entry, open_entry
from poise.robots._describe import describe
from poise.robots._description import Description, Mount, match_joints, parse_description
from poise.robots._document import Document, free_name, read_document
from poise.robots._inputs import RobotInput, description_of, open_document, path_of
from poise.robots._limits import (
    assume_limits,
    check_inertia,
    check_positions,
    described_limits,
    hinges,
)
from poise.robots._posture import home_configuration
from poise.robots._robot import FrameRole, Robot, Sole
from poise.robots._soles import check_roles, soles_off_their_feet, with_controlled_soles


def load_robot(
    name_or_model: RobotInput,
    description: str | Path | Mapping[str, object] | None = None,
    *,
    geometry: pin.GeometryModel | None = None,
) -> Robot:
    """Load a robot by its name in the catalog, or from any model of it.

    Args:
        name_or_model: a name that `poise robots` lists, `humanoid20` to `humanoid60`; a path to a
            URDF, MJCF or xacro file; XML text; a `pin.Model`, `mujoco.MjModel` or `mujoco.MjSpec`;
            or a module of robot_descriptions.
        description: the YAML file (or its content) with the facts that a model does not hold; by
            default `<stem>.poise.yaml` beside a file. Without either the facts are guessed, as
            `describe` does, and a warning lists the guesses and `describe`'s remarks.
        geometry: shapes of a `pin.Model`.

    Returns:
        The robot, which has the name of the model: that of `<robot name>` or `<mujoco model>`.

    Raises:
        UnknownNameError: no such robot, link or joint.
        RobotError: a file, mesh, inertia, limit or fact is missing or wrong, or this is no model.
        MissingExtraError: the robot's files come with an extra that is not installed.
    """
    entry = find_entry(name_or_model) if isinstance(name_or_model, str) else None
    if entry is not None:
        if description is not None:
            what = "a robot of the catalog has a description"
            raise RobotError(what, got=description, wanted="none, or a path such as ./NAME")
        text, directory, packages = open_entry(entry)
        document = read_document(text, entry.name, directory, packages, name=entry.name)
        return _assemble(document, entry.description)[0]
    path = path_of(name_or_model)
    if path is not None and not path.suffix and not os.path.isfile(path):
        got = name_or_model if isinstance(name_or_model, str) else str(path)
        raise UnknownNameError("unknown robot", got=got, choices=catalog_names())
    document = open_document(name_or_model, geometry)
    facts, guessed = _find_description(document, path, description, name_or_model, geometry)
    robot, notes = _assemble(document, facts)
    if document.has_shapes and not guessed:
        notes += soles_off_their_feet(robot)
    if guessed or notes:
        # A proposal's remarks and the notes of its load may be the same.
        notes = list(dict.fromkeys([*guessed, *notes]))
        warnings.warn(f"{document.where}: {'; '.join(notes)}", stacklevel=2)
    return robot


def description_template(model: RobotInput) -> str:
    """A description file to fill in, with the links and joints of a model as comments.

    Args:
        model: as `load_robot` takes it.

    Returns:
        YAML text.

    Raises:
        RobotError: the model cannot be read.
    """
    document = open_document(model)
    stem = description_of(path_of(model) or Path(document.name)).name
    links, joints = ", ".join(document.links()), ", ".join(document.joints())
    return f"""# Facts about {document.where}: save as {stem} beside it.
# Links: {links}
# Joints: {joints}
base: floating            # or: fixed
pelvis: LINK              # or: {{link: LINK, position: [0, 0, 0], rpy: [0, 0, 0]}}
torso: LINK
soles:                    # centre of each sole, x forward, z up [m, rad]; left first
  left_sole: {{link: LINK, position: [0, 0, 0], rpy: [0, 0, 0], length: 0.2, width: 0.1}}
  right_sole: {{link: LINK, position: [0, 0, 0], rpy: [0, 0, 0], length: 0.2, width: 0.1}}
hands:                    # optional
  left_hand: {{link: LINK, position: [0, 0, 0]}}
home: {{}}                  # joint or pattern: angle [rad]
limits:                   # only what the file lacks; joint or pattern: value
  torque: {{}}              # [N m]
  velocity: {{}}            # [rad/s]
  position: {{}}            # [lower, upper] [rad]
armature: 0.0             # reflected rotor inertia [kg m^2], one for all or by pattern
locked: []                # joints to weld at zero
licence: not stated
"""


def _find_description(
    document: Document,
    path: Path | None,
    given: Any,
    model: RobotInput,
    geometry: pin.GeometryModel | None,
) -> tuple[Description, list[str]]:
    """The description of a model; where there is none, guesses and remarks as sentences."""
    if isinstance(given, Mapping):
        return parse_description(dict(given), f"description of {document.where}"), []
    if given is not None and not isinstance(given, str | os.PathLike):
        raise RobotError("this is no description", got=given, wanted="a path or a mapping")
    beside = None if path is None else description_of(path)
    file = beside if given is None else Path(given)
    if file is None or (given is None and not file.is_file()):
        proposal = describe(model, geometry)
        facts = parse_description(proposal.facts, f"description guessed for {document.where}")
        shown = f"guessed: {proposal.summary}"
        if file is not None:
            shown = f"guessed, as there is no {file.name}: {proposal.summary}"
            shown += f" (`poise describe {path}` shows and writes it)"
        return facts, [shown, *proposal.remarks]
    data = read_yaml(read_text(file, error=RobotError), file.name, error=RobotError)
    return parse_description(data, file.name), []


def _assemble(document: Document, facts: Description) -> tuple[Robot, list[str]]:
    """The robot, and remarks on what was assumed, repaired or left out."""
    floating, name, where = facts.base == "floating", document.name, document.where
    names = document.joints()
    limits = described_limits(facts, names)
    locked = match_joints(dict.fromkeys(facts.locked, True), names, f"{facts.where}: locked")
    # As limits, an armature may be that of a joint that is locked.
    armature = match_joints(facts.armature, names, f"{facts.where}: armature")
    assembly = assemble(
        document,
        facts.base,
        limits,
        locked=locked,
        taken={*facts.mounts(), "pelvis", "torso"},
    )
    model, source = assembly.model, assembly.source
    if model.nv == 0:
        wanted = "a hinge or slide that is not locked"
        raise RobotError(f"{where} has no joint to move", got=names, wanted=wanted)
    for joint_name, joint in hinges(model):
        if joint_name in armature:
            model.armature[joint.idx_v] = armature[joint_name]
    free = [n for n in names if n not in source.locked_joints]
    posture = match_joints(facts.home, free, f"{facts.where}: home")
    check_inertia(model, where)
    check_positions(model, where)
    roles = _roles(facts, assembly.root)
    _add_roles(model, roles, where)
    assumed = assume_limits(model, facts.soles)
    # Pinocchio leaves lower ones that are above those of a model without limits, and refuses them.
    model.lowerVelocityLimit[:] = -model.velocityLimit
    model.lowerEffortLimit[:] = -model.effortLimit
    soles = {n: Sole(name=n, length=s.length, width=s.width) for n, s in facts.soles.items()}
    q_home = home_configuration(model, soles, posture, floating=floating, where=where)
    base_q, base_v, first = (7, 6, 2) if floating else (0, 0, 1)
    robot = Robot(
        name=name,
        model=model,
        floating_base=floating,
        joint_names=tuple(model.names)[first:],
        q_min=_frozen(model.lowerPositionLimit[base_q:]),
        q_max=_frozen(model.upperPositionLimit[base_q:]),
        v_max=_frozen(model.velocityLimit[base_v:]),
        tau_max=_frozen(model.effortLimit[base_v:]),
        soles=MappingProxyType(soles),
        hands=tuple(facts.hands),
        pelvis="pelvis",
        torso="torso",
        roles=MappingProxyType(roles),
        q_home=_frozen(q_home),
        licence=facts.licence,
        source=source,
    )
    check_roles(robot)
    return with_controlled_soles(robot), [
        *(f"assumed are {a}" for a in assumed),
        *assembly.remarks,
    ]


def _roles(facts: Description, root: str) -> dict[str, FrameRole]:
    mounts = dict.fromkeys(("pelvis", "torso"), Mount(link=root)) | facts.mounts()
    # Soles first, as the description orders them, then hands and trunk.
    order = [*facts.soles, *facts.hands, "pelvis", "torso"]
    return {
        name: FrameRole(
            name=name,
            link=mounts[name].link,
            position=_frozen(mounts[name].position),
            rotation=_frozen(pin.rpy.rpyToMatrix(*mounts[name].rpy)),
        )
        for name in order
    }


def _frozen(array: Float64[np.ndarray, "*n"]) -> Float64[np.ndarray, "*n"]:
    copy = np.array(array, dtype=np.float64)
    copy.flags.writeable = False
    return copy


def _add_roles(model: pin.Model, roles: Mapping[str, FrameRole], where: str) -> None:
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


def _free_names(model: pin.Model, names: set[str]) -> None:
    taken = {f.name for f in model.frames} | names
    for frame in [f for f in model.frames if f.name in names]:
        suffix = "_link" if frame.type == pin.FrameType.BODY else "_joint"
        frame.name = free_name(frame.name + suffix, taken)
        taken.add(frame.name)
