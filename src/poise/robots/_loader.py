"""`load_robot`: from a name or a file to a `Robot`."""

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import few
from poise._yaml import read_text, read_yaml
from poise.errors import RobotError, UnknownNameError
from poise.robots._base import followers_of, settle_base
from poise.robots._catalog import catalog_names, find_entry, open_entry
from poise.robots._describe import describe
from poise.robots._description import Description, Mount, match_joints, parse_description
from poise.robots._document import Document, mend_inertias, parse, write_limits
from poise.robots._files_digest import DESCRIPTION_SUFFIX
from poise.robots._kinematics import add_roles, build_model, check_inertia
from poise.robots._limits import (
    apply_limits,
    assume_limits,
    check_positions,
    described_limits,
    tighten_torques,
)
from poise.robots._meshes import add_figure, asset_folders, drop_missing_meshes, has_shapes
from poise.robots._mjcf_facts import MjcfFacts, read_facts
from poise.robots._mjcf_world import free_site_names
from poise.robots._posture import home_configuration
from poise.robots._robot import FrameRole, ModelSource, Robot, Sole
from poise.robots._soles import check_roles, soles_off_their_feet, with_controlled_soles


def load_robot(
    name_or_path: str | Path, description: str | Path | Mapping[str, object] | None = None
) -> Robot:
    """Load a robot by its name in the catalog, or from a URDF or MJCF file.

    Args:
        name_or_path: a name that `poise robots` lists, `humanoid20` to `humanoid60`, or a file.
        description: for a file, the YAML file (or its content) with the facts that the model file
            does not hold; by default `<stem>.poise.yaml` beside it. Without either the facts are
            guessed, as `describe` does, and a warning lists the guesses and `describe`'s remarks.

    Returns:
        The robot.

    Raises:
        UnknownNameError: no such robot, link or joint.
        RobotError: a file, mesh, inertia, limit or fact is missing or wrong.
        MissingExtraError: the robot's files come with an extra that is not installed.
    """
    entry = find_entry(str(name_or_path)) if description is None else None
    if entry is not None:
        text, directory, packages = open_entry(entry)
        document = parse(text, entry.name, directory)
        return _assemble(entry.name, document, entry.description, directory, packages)[0]
    path = Path(name_or_path)
    if not path.suffix and not path.is_file():
        raise UnknownNameError("unknown robot", got=str(name_or_path), choices=catalog_names())
    text = read_text(path, error=RobotError)
    document = parse(text, path.name, path.parent)
    facts, guessed = _find_description(path, description)
    shown = has_shapes(document.root)
    robot, notes = _assemble(path.stem, document, facts, *asset_folders(document, path))
    if shown and not guessed:
        notes += soles_off_their_feet(robot)
    if guessed or notes:
        # A proposal's remarks and the notes of its load may say the same.
        notes = list(dict.fromkeys([*guessed, *notes]))
        warnings.warn(f"{path.name}: {'; '.join(notes)}", stacklevel=2)
    return robot


def description_template(path: str | Path) -> str:
    """A description file to fill in, with the links and joints of a model file as comments.

    Args:
        path: a URDF or MJCF file.

    Returns:
        YAML text.

    Raises:
        RobotError: the file cannot be read.
    """
    path = Path(path)
    document = parse(read_text(path, error=RobotError), path.name, path.parent)
    links, joints = ", ".join(document.links()), ", ".join(document.joints())
    return f"""# Facts about {path.name}: save as {path.stem}{DESCRIPTION_SUFFIX} beside it.
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
    path: Path, given: str | Path | Mapping[str, object] | None
) -> tuple[Description, list[str]]:
    """The description of a file; where there is none, what was guessed and seen, as sentences."""
    if isinstance(given, Mapping):
        return parse_description(dict(given), f"description of {path.name}"), []
    file = Path(given) if given is not None else path.with_name(path.stem + DESCRIPTION_SUFFIX)
    if given is None and not file.is_file():
        proposal = describe(path)
        facts = parse_description(proposal.facts, f"description guessed for {path.name}")
        where_from = f"guessed, as there is no {file.name}: {proposal.summary}"
        shown = f"{where_from} (`poise describe {path}` shows and writes it)"
        return facts, [shown, *proposal.remarks]
    data = read_yaml(read_text(file, error=RobotError), file.name, error=RobotError)
    return parse_description(data, file.name), []


def _assemble(
    name: str,
    document: Document,
    facts: Description,
    directory: Path | None,
    packages: tuple[Path, ...],
) -> tuple[Robot, list[str]]:
    """The robot, and what was assumed or left out of it."""
    floating = facts.base == "floating"
    mjcf = read_facts(document, directory) if document.kind == "mjcf" else None
    root = settle_base(document, facts.base)
    names = document.joints()
    limits = described_limits(facts, names)
    locked = match_joints(dict.fromkeys(facts.locked, True), names, f"{facts.where}: locked")
    followers = [j for j in followers_of(document, mjcf) if j not in locked]
    if document.kind == "urdf":
        write_limits(document, limits.position, limits.velocity, limits.torque)
    else:
        free_site_names(document.root, {*facts.mounts(), "pelvis", "torso"})
    source = ModelSource(
        kind=document.kind,
        text=document.text,
        directory=directory,
        package_dirs=packages,
        locked_joints=(*locked, *followers),
    )
    notes = _left_out(mjcf, followers, drop_missing_meshes(document.root, source, name))
    if mended := mend_inertias(document):
        notes.append(f"inertias that no body has are made possible: {few(mended)}")
    source = replace(source, text=document.text)
    free = [n for n in names if n not in source.locked_joints]
    # As limits, it may be that of a joint that somebody locked afterwards.
    armature = match_joints(facts.armature, names, f"{facts.where}: armature")
    armature = {joint: inertia for joint, inertia in armature.items() if joint in free}
    posture = match_joints(facts.home, free, f"{facts.where}: home")
    model = build_model(source, floating=floating, armature=armature, where=name)
    check_inertia(model, name)
    if document.kind == "urdf" and add_figure(document.root):
        source = replace(source, text=document.text)
    if mjcf is not None:
        tighten_torques(model, mjcf.torque)
    apply_limits(model, limits.position, limits.velocity, limits.torque)
    check_positions(model, floating=floating, where=name)
    roles = _roles(facts, root)
    add_roles(model, roles, name)
    assumed = assume_limits(model, facts.soles, floating=floating)
    # Pinocchio leaves lower ones that are above those of a model without limits, and refuses them.
    model.lowerVelocityLimit[:] = -model.velocityLimit
    model.lowerEffortLimit[:] = -model.effortLimit
    soles = {n: Sole(name=n, length=s.length, width=s.width) for n, s in facts.soles.items()}
    q_home = home_configuration(model, soles, posture, floating=floating, where=name)
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
    return with_controlled_soles(robot), [*(f"assumed are {a}" for a in assumed), *notes]


def _left_out(mjcf: MjcfFacts | None, followers: list[str], meshes: list[str]) -> list[str]:
    """What a robot does not take from its document, as sentences."""
    notes: list[str] = []
    if followers:
        notes.append(f"joints that mimic others are locked at zero: {few(followers)}")
    if mjcf is not None and mjcf.loops:
        notes.append(f"loops that these equalities close are left open: {few(mjcf.loops)}")
    if mjcf is not None and mjcf.springs:
        notes.append(f"springs are left out: {few(mjcf.springs)}")
    if meshes:
        notes.append(f"meshes that cannot be found are missing in pictures: {few(meshes)}")
    return notes


def _roles(facts: Description, root: str) -> dict[str, FrameRole]:
    at_root = Mount(link=root)
    mounts = {"pelvis": at_root, "torso": at_root} | facts.mounts()
    # Soles first, as the description orders them, then hands and trunk.
    order = [*facts.soles, *facts.hands, "pelvis", "torso"]
    return {name: _role(name, mounts[name]) for name in order}


def _role(name: str, mount: Mount) -> FrameRole:
    rotation = pin.rpy.rpyToMatrix(*mount.rpy)
    return FrameRole(
        name=name, link=mount.link, position=_frozen(mount.position), rotation=_frozen(rotation)
    )


def _frozen(array: Float64[np.ndarray, "*n"]) -> Float64[np.ndarray, "*n"]:
    copy = np.array(array, dtype=np.float64)
    copy.flags.writeable = False
    return copy
