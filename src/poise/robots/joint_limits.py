"""Joint limits that a description gives in place of the document's, and the check of all limits."""

import math
from dataclasses import dataclass

import pinocchio as pin

from poise.errors import RobotError
from poise.robots.description import Description, match_joints


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
        position=match_joints(facts.position, joints, f"{where}.position"),
        velocity=match_joints(facts.velocity, joints, f"{where}.velocity"),
        torque=match_joints(facts.torque, joints, f"{where}.torque"),
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
