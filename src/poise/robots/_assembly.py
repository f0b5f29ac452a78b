"""`assemble`: from a document to the model of a robot, each coupled pair as one joint."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import pinocchio as pin

from poise._show import few
from poise.errors import RobotError
from poise.robots._document import Base, Coupling, Document, JointLimits
from poise.robots._limits import apply_limits, hinges
from poise.robots._mesh_files import drop_missing_meshes
from poise.robots._robot import ModelSource

_GEAR = 2.0
"""An output moves more than so many times the mass of its gear; mirrored fingers are equal."""

_LINK = "\n(link)"  # Behind the name of a link that a joint has, too, for the time being
_WRITTEN = 1e-4  # Keyframes are written with about so many digits [rad, m]


@dataclass(frozen=True, kw_only=True)
class AssembledModel:
    """A document's robot."""

    model: pin.Model  # Pinocchio's, without the joints that are welded
    source: ModelSource  # the settled document
    root: str  # its root link
    grips: frozenset[str]  # joints that drive others, as those of grippers do
    poses: dict[str, dict[str, float]]  # joint positions by keyframe, within the limits [rad, m]
    clipped: tuple[str, ...]  # keyframes that were not, as sentences
    remarks: tuple[str, ...]  # what was repaired, left out and welded, as sentences


def assemble(
    document: Document,
    base: Base,
    limits: JointLimits,
    *,
    locked: Iterable[str] = (),
    taken: Iterable[str] = (),
) -> AssembledModel:
    """Settle a document and build its model."""
    facts, floating = document.facts, base == "floating"
    root = document.settle(base)
    document.write_limits(limits)
    document.free_names(set(taken))
    lost = drop_missing_meshes(document)
    remarks = [*document.remarks, *facts.remarks]
    if lost:
        remarks.append(f"meshes that cannot be found are missing in pictures: {few(lost)}")
    if mended := document.mend_inertias():
        remarks.append(f"inertias that no body has are made possible: {few(mended)}")
    model = document.build(floating=floating)
    _check_freedoms(model, floating, document.where)
    for name, joint in hinges(model):
        speed = float(model.velocityLimit[joint.idx_v])
        model.velocityLimit[joint.idx_v] = document.velocity.get(name, speed)
        limit = float(model.effortLimit[joint.idx_v])
        model.effortLimit[joint.idx_v] = min(limit, facts.torque.get(name, limit))
    fixed = set(locked)
    known = {*document.joints(), ""}
    tied = [c for c in facts.couplings if {c.follower, c.leader} <= known]
    free = [c for c in tied if not {c.follower, c.leader} & fixed]
    # A follower of a locked joint stands still, too.
    still = [c.follower for c in tied if c.leader in fixed]
    swapped = _gears(model, free)
    apply_limits(model, limits)
    gears = [gear for gear, _ in swapped]
    followers = [c.follower for c in free if c.follower not in [output for _, output in swapped]]
    followers += still
    if followers:
        remarks.append(f"joints that mimic others are locked at zero: {few(followers)}")
    if gears:
        outputs = few([output for _, output in swapped if output not in gears])
        said = "gears are one joint with their output, which has their torque, speed and rotor"
        remarks.append(f"{said}: {outputs}")
    source = document.source(dict.fromkeys([*locked, *followers, *gears]))
    poses, clipped = _within_limits(model, facts.poses)
    return AssembledModel(
        model=welded(model, source.locked_joints),
        poses=poses,
        clipped=clipped,
        source=source,
        root=root,
        grips=frozenset(c.leader for c in free if c.leader and c.leader not in gears),
        remarks=tuple(remarks),
    )


def _within_limits(
    model: pin.Model, poses: Mapping[str, Mapping[str, float]]
) -> tuple[dict[str, dict[str, float]], tuple[str, ...]]:
    """Poses with each joint inside its limits, and sentences about those that were not."""
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    ends = {name: (low[joint.idx_q], high[joint.idx_q]) for name, joint in hinges(model)}
    clipped = {
        pose: {name: min(max(at, ends[name][0]), ends[name][1]) for name, at in joints.items()}
        for pose, joints in poses.items()
    }
    beyond = {
        pose: [name for name, at in joints.items() if abs(at - clipped[pose][name]) > _WRITTEN]
        for pose, joints in poses.items()
    }
    return clipped, tuple(
        f"keyframe {pose!r} is outside the limits and clipped: {few(names)}"
        for pose, names in beyond.items()
        if names
    )


def _check_freedoms(model: pin.Model, floating: bool, where: str) -> None:
    for joint in list(model.joints)[2 if floating else 1 :]:
        if joint.nv != 1 or joint.nq != 1:
            raise RobotError(
                f"joint {model.names[joint.id]!r} of {where} has the wrong type",
                got=joint.shortname(),
                wanted="a hinge or slide with one position variable",
            )


def _gears(model: pin.Model, couplings: Sequence[Coupling]) -> list[tuple[str, str]]:
    """Leaders that move little of what their follower does: the output stands for both.

    With q_output = offset + ratio q_gear the output has the gear's torque over |ratio|, its speed
    times |ratio|, and its rotor inertia over ratio^2.
    """
    data = model.createData()
    pin.computeSubtreeMasses(model, data)
    outputs: dict[str, Coupling] = {}
    for coupling in couplings:
        if not coupling.leader or coupling.ratio == 0.0:
            continue
        gear, output = (model.getJointId(n) for n in (coupling.leader, coupling.follower))
        if data.mass[output] > _GEAR * data.mass[gear]:
            kept = outputs.setdefault(coupling.leader, coupling)
            if data.mass[output] > data.mass[model.getJointId(kept.follower)]:
                outputs[coupling.leader] = coupling
    # A gear of a gear first: each moves less than its output.
    for coupling in sorted(outputs.values(), key=lambda c: data.mass[model.getJointId(c.follower)]):
        _take_on(model, coupling)
    return [(gear, coupling.follower) for gear, coupling in outputs.items()]


def _take_on(model: pin.Model, coupling: Coupling) -> None:
    """Give an output its gear's drive and limits."""
    gear, output = (
        model.joints[model.getJointId(name)] for name in (coupling.leader, coupling.follower)
    )
    ratio = abs(coupling.ratio)
    for limits, factor in ((model.effortLimit, 1.0 / ratio), (model.velocityLimit, ratio)):
        if limits[gear.idx_v] > 0.0:
            own = limits[output.idx_v] if limits[output.idx_v] > 0.0 else float("inf")
            limits[output.idx_v] = min(own, factor * limits[gear.idx_v])
    model.armature[output.idx_v] += model.armature[gear.idx_v] / ratio**2
    ends = sorted(
        coupling.offset + coupling.ratio * float(limit[gear.idx_q])
        for limit in (model.lowerPositionLimit, model.upperPositionLimit)
    )
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    if ends[0] < ends[1]:
        low[output.idx_q] = max(low[output.idx_q], ends[0])
        high[output.idx_q] = min(high[output.idx_q], ends[1])


def welded(model: pin.Model, names: Sequence[str]) -> pin.Model:
    """The model without some joints, at zero; rotor inertias of the others stay theirs."""
    if not names:
        return model
    armature = {n: model.armature[j.idx_v] for n, j in hinges(model)}
    joints = [model.getJointId(name) for name in names]
    # Pinocchio refuses lower limits above the upper ones, as those of a model without any are.
    model.lowerVelocityLimit[:] = -model.velocityLimit
    model.lowerEffortLimit[:] = -model.effortLimit
    # Pinocchio looks joints' frames up by names, which links may share.
    shared = set(model.names)
    for frame in [*model.frames][1:]:
        if frame.type != pin.FrameType.JOINT and frame.name in shared:
            frame.name += _LINK
    reduced = pin.buildReducedModel(model, joints, pin.neutral(model))
    for frame in [*model.frames, *reduced.frames]:
        frame.name = frame.name.removesuffix(_LINK)
    for name, joint in hinges(reduced):
        reduced.armature[joint.idx_v] = armature[name]
    return reduced
