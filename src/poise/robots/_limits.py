"""Joint limits and inertias of a model: described, checked, assumed."""

from collections.abc import Iterable, Mapping

import numpy as np
import pinocchio as pin

from poise._show import few
from poise.errors import RobotError
from poise.robots._description import Description, match_joints
from poise.robots._document import JointLimits
from poise.robots._robot import GRAVITY
from poise.robots._urdf import crossed_limits

_MIN_INERTIA = 1e-9
"""Smallest eigenvalue of the mass matrix that still counts as a mass [kg or kg m^2]."""


def hinges(model: pin.Model) -> list[tuple[str, pin.JointModel]]:
    """Names and joints of a model, without the world and a free base."""
    joints = list(zip(model.names, model.joints, strict=True))[1:]
    return [(name, joint) for name, joint in joints if joint.nv == 1]


def described_limits(facts: Description, joints: tuple[str, ...]) -> JointLimits:
    """Match the patterns of a description's limits with the joints of a document."""
    given, where = facts.limits, f"{facts.where}: limits"
    return JointLimits(
        position=match_joints(given.position, joints, f"{where}.position"),
        velocity=match_joints(given.velocity, joints, f"{where}.velocity"),
        torque=match_joints(given.torque, joints, f"{where}.torque"),
    )


def apply_limits(model: pin.Model, limits: JointLimits) -> None:
    """Put limits by joint into a model, in place of its own."""
    for name, joint in hinges(model):
        q, v = joint.idx_q, joint.idx_v
        if name in limits.position:
            model.lowerPositionLimit[q], model.upperPositionLimit[q] = limits.position[name]
        model.velocityLimit[v] = limits.velocity.get(name, model.velocityLimit[v])
        model.effortLimit[v] = limits.torque.get(name, model.effortLimit[v])


def check_positions(model: pin.Model, where: str) -> None:
    """Check that every joint has position limits that leave it room to move."""
    lacking: list[str] = []
    crossed: dict[str, tuple[float, float]] = {}
    for name, joint in hinges(model):
        low = float(model.lowerPositionLimit[joint.idx_q])
        high = float(model.upperPositionLimit[joint.idx_q])
        if low > high:
            crossed[name] = low, high
        elif not _is_size(high - low):
            lacking.append(name)
    if crossed:
        raise crossed_limits(where, crossed)
    if lacking:
        raise RobotError(
            f"{where} has joints whose limits are zero or missing",
            got={"limits.position": lacking},
            wanted="these limits in the model file, or under `limits` in its description",
        )


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
    mass = np.nan_to_num(np.triu(data.M) + np.triu(data.M, 1).T, nan=0.0, posinf=0.0, neginf=0.0)
    values, vectors = np.linalg.eigh(mass)
    if values[0] > _MIN_INERTIA:
        return
    still = {
        names[i]
        for i in range(1, model.njoints)
        # With a part in the motion of unit norm.
        if np.abs(vectors[model.joints[i].idx_v, 0]) > 0.1
    }
    raise RobotError(
        f"{where} can move without inertia",
        got=sorted(still),
        wanted="positive inertias behind these joints, or an armature in the description",
    )


NO_LIMIT = 1e300
"""Numbers from here on stand for none: Pinocchio has the largest float where nothing is given."""


def _is_size(value: float) -> bool:
    """Positive and finite."""
    return 0.0 < value < NO_LIMIT


_SPEED = {"revolute": 10.0, "prismatic": 1.0}
"""Assumed velocity limits [rad/s, m/s]: typical of motors in robots of human size."""

_LEG_PART = 0.3
"""Assumed torque of a joint that carries the robot, in weight times leg length: a knee needs 0.1 to
0.2 to squat with both legs, and shipped humanoids have 0.15 to 0.5."""

_ARM_PART = 3.0
"""Assumed torque of another joint, in what holds up the rest of its limb at arm's length."""

_LEAST_PART, _LEAST = 0.003, 1e-3
"""No joint is assumed weaker than this, in weight times leg length, or than this [N m]."""


def assume_limits(model: pin.Model, soles: Iterable[str]) -> list[str]:
    """Fill in the velocity and torque limits that a model lacks."""
    said: list[str] = []
    joints = hinges(model)
    slow = [j for _, j in joints if not _is_size(float(model.velocityLimit[j.idx_v]))]
    for joint in slow:
        model.velocityLimit[joint.idx_v] = _SPEED[joint_kind(joint)]
    if slow:
        speeds = {j.id: float(model.velocityLimit[j.idx_v]) for j in slow}
        said.append(f"velocity limits of {_by_kind(model, speeds, turns='rad/s', slides='m/s')}")
    weak = [j for _, j in joints if not _is_size(float(model.effortLimit[j.idx_v]))]
    if weak:
        torques = _assumed_torques(model, [model.frames[model.getFrameId(s)] for s in soles])
        for joint in weak:
            model.effortLimit[joint.idx_v] = torques[joint.id]
        spread = _by_kind(model, {j.id: torques[j.id] for j in weak}, turns="N m", slides="N")
        said.append(f"torque limits of {spread}, from the weights they carry")
    return said


def _by_kind(model: pin.Model, limits: Mapping[int, float], *, turns: str, slides: str) -> str:
    """The limits of hinges and of slides, each in their unit and with the joints' names."""
    parts: list[str] = []
    for kind, unit in (("revolute", turns), ("prismatic", slides)):
        of_kind = {j: limit for j, limit in limits.items() if joint_kind(model.joints[j]) == kind}
        if of_kind:
            ends = (f"{min(of_kind.values()):.3g}", f"{max(of_kind.values()):.3g}")
            spread = " to ".join(dict.fromkeys(ends))
            parts.append(f"{spread} {unit} for {few([model.names[j] for j in of_kind])}")
    return " and ".join(parts)


def joint_kind(joint: pin.JointModel) -> str:
    """Return "revolute" or "prismatic" for a joint of one freedom."""
    return "prismatic" if "P" in joint.shortname().removeprefix("JointModel")[:1] else "revolute"


def _assumed_torques(model: pin.Model, soles: list[pin.Frame]) -> dict[int, float]:
    """Torques by joint [N m]; forces of slides [N]."""
    data = model.createData()
    pin.centerOfMass(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    weight = float(data.mass[0]) * GRAVITY
    hips = data.oMi[1].translation
    feet = [(data.oMi[s.parentJoint] * s.placement).translation for s in soles]
    size = weight * max((float(np.linalg.norm(f - hips)) for f in feet), default=0.0)
    carrying = {int(j) for s in soles for j in model.supports[s.parentJoint]}
    torques: dict[int, float] = {}
    for joint in range(1, model.njoints):
        held = float(data.mass[joint]) * GRAVITY
        if joint_kind(model.joints[joint]) == "prismatic":
            torques[joint] = weight if joint in carrying else _ARM_PART * held
        elif joint in carrying:
            torques[joint] = _LEG_PART * size
        else:
            # The subtree's CoM is in the joint's own frame, whose origin is on its axis.
            # What weighs nothing, as fingers in some files, has none.
            arm = float(np.linalg.norm(data.com[joint])) if held > 0.0 else 0.0
            torques[joint] = max(_ARM_PART * held * arm, _LEAST_PART * size, _LEAST)
    return torques
