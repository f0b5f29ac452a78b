"""An arm of the parametric humanoid: four joints or more between the torso and the hand."""

from dataclasses import dataclass
from typing import Literal

from poise.robots.parametric.shapes import Shape, box, capsule, drum, sphere
from poise.robots.parametric.tree import Tree, degrees


@dataclass(frozen=True, kw_only=True)
class _ArmJoint:
    """A joint of the arm; `station` is its place between shoulder, 0, and wrist, 1."""

    name: str
    axis: Literal["x", "y", "z"]
    station: float
    span: tuple[float, float]
    torque: float


_CLAVICLE = _ArmJoint(name="clavicle", axis="z", station=0.0, span=(-30.0, 30.0), torque=100.0)

_CORE = (
    _ArmJoint(name="shoulder_pitch", axis="y", station=0.0, span=(-170.0, 60.0), torque=100.0),
    _ArmJoint(name="shoulder_roll", axis="x", station=0.0, span=(-15.0, 165.0), torque=100.0),
    _ArmJoint(name="shoulder_yaw", axis="z", station=0.2, span=(-95.0, 95.0), torque=60.0),
    _ArmJoint(name="elbow", axis="y", station=0.52, span=(-145.0, 5.0), torque=80.0),
    _ArmJoint(name="forearm_yaw", axis="z", station=0.66, span=(-120.0, 120.0), torque=40.0),
    _ArmJoint(name="wrist_pitch", axis="y", station=1.0, span=(-80.0, 80.0), torque=25.0),
    _ArmJoint(name="wrist_roll", axis="x", station=1.0, span=(-60.0, 60.0), torque=25.0),
)

_CLAVICLE_OFFSET = 0.62
"""The clavicle joint's distance from the middle, as a share of the shoulder's."""

_JOINT_WEIGHT, _LENGTH_WEIGHT, _HAND_WEIGHT = 1.0, 12.0, 1.2
"""Shares of an arm's mass: a joint's motor, a whole arm's length of structure, the hand."""


def arm_joints(count: int) -> tuple[_ArmJoint, ...]:
    """The joints of an arm from shoulder to hand, without the clavicle.

    Four joints are shoulder pitch, roll, yaw and elbow; then come forearm yaw, wrist pitch and
    wrist roll. What lies beyond eight (the eighth is the clavicle) are hinges across the arm.
    """
    core = _CORE[: min(count, len(_CORE))]
    extra = max(0, count - len(_CORE) - 1)
    hinges = tuple(
        _ArmJoint(
            name=f"hinge{i + 1}",
            axis="x" if i % 2 == 0 else "y",
            station=0.1 + 0.85 * (i + 0.5) / extra,
            span=(-30.0, 30.0),
            torque=60.0,
        )
        for i in range(extra)
    )
    return tuple(sorted((*core, *hinges), key=lambda j: j.station))


def add_arm(
    tree: Tree,
    side: Literal["left", "right"],
    *,
    joints: int,
    parent: str,
    shoulder: tuple[float, float, float],
    length: float,
    mass: float,
    strength: float,
    accent: str,
) -> None:
    """Hang an arm on the torso. All angles zero means that it hangs straight down.

    Args:
        tree: the robot, with the link `parent`.
        side: which arm.
        joints: number of joints, at least 4.
        parent: the link that carries the arm.
        shoulder: place of the left shoulder in the parent [m].
        length: from shoulder to wrist [m].
        mass: mass of the arm [kg].
        strength: torque limits against those of a robot of 1.8 m and 100 kg.
        accent: colour of the covers.
    """
    sign = 1.0 if side == "left" else -1.0
    size = length / 0.55
    chain = arm_joints(joints)
    ends = [j.station for j in chain[1:]] + [1.0]
    spans = [(end - j.station) * length for j, end in zip(chain, ends, strict=True)]
    has_clavicle = joints > len(_CORE)
    weights = [_JOINT_WEIGHT + _LENGTH_WEIGHT * span / length for span in spans]
    shares = sum(weights) + _HAND_WEIGHT + (_JOINT_WEIGHT if has_clavicle else 0.0)
    unit = mass / shares
    x, y, z = shoulder
    at = (x, sign * y, z)
    if has_clavicle:
        root = _CLAVICLE_OFFSET * y
        child = f"{side}_clavicle_link"
        _connect(tree, side, _CLAVICLE, parent, child, (x, sign * root, z), strength)
        tree.add(child, unit * _JOINT_WEIGHT, _clavicle_shapes(size, sign * (y - root)))
        parent, at = child, (0.0, sign * (y - root), 0.0)
    for i, (joint, span) in enumerate(zip(chain, spans, strict=True)):
        child = f"{side}_{joint.name}_link"
        _connect(tree, side, joint, parent, child, at, strength)
        tree.add(child, unit * weights[i], _segment_shapes(joint, span, size, sign, accent))
        parent, at = child, (0.0, 0.0, -span)
    tree.weld(parent, f"{side}_hand_link", at=at)
    tree.add(f"{side}_hand_link", unit * _HAND_WEIGHT, _hand_shapes(size, sign))


def _connect(
    tree: Tree,
    side: str,
    joint: _ArmJoint,
    parent: str,
    child: str,
    at: tuple[float, float, float],
    strength: float,
) -> None:
    low, high = degrees(*joint.span)
    mirrored = side == "right" and joint.axis != "y"
    tree.connect(
        f"{side}_{joint.name}",
        parent,
        child,
        at=at,
        axis=joint.axis,
        span=(-high, -low) if mirrored else (low, high),
        torque=joint.torque * strength,
        velocity=10.0,
    )


def _clavicle_shapes(size: float, reach: float) -> tuple[Shape, ...]:
    return (
        drum("z", 0.05 * size, 0.10 * size),
        *capsule((0.0, 0.0, 0.0), (0.0, 0.8 * reach, 0.0), 0.043 * size, colour="dark"),
    )


def _segment_shapes(
    joint: _ArmJoint, span: float, size: float, sign: float, accent: str
) -> tuple[Shape, ...]:
    radius = (0.056 - 0.018 * joint.station) * size
    if joint.name == "shoulder_pitch":
        return (
            drum("y", 0.058 * size, 0.09 * size),
            sphere(0.072 * size, (0.0, sign * 0.018 * size, 0.018 * size), colour=accent),
        )
    if joint.axis == "z":
        ring = drum("z", 1.04 * radius, 0.022 * size)
    else:
        # Hidden under the shoulder's cover, a hinge across x is shorter.
        ring = drum(joint.axis, 0.85 * radius, (2.25 if joint.station > 0.0 else 1.9) * radius)
    if span < 0.02 * size:
        return (ring,)
    body = capsule((0.0, 0.0, -0.2 * span), (0.0, 0.0, -0.86 * span), 0.9 * radius)
    return (ring, *body)


def _hand_shapes(size: float, sign: float) -> tuple[Shape, ...]:
    """A palm, a thumb towards the front and four fingers."""
    palm = box((0.075 * size, 0.03 * size, 0.085 * size), (0.0, 0.0, -0.075 * size))
    fingers = tuple(
        shape
        for k in range(4)
        for shape in capsule(
            ((0.027 - 0.018 * k) * size, 0.0, -0.115 * size),
            ((0.027 - 0.018 * k) * size, -sign * 0.012 * size, -0.175 * size),
            0.0085 * size,
            colour="dark",
        )
    )
    thumb = capsule(
        (0.038 * size, 0.0, -0.06 * size),
        (0.06 * size, -sign * 0.012 * size, -0.105 * size),
        0.01 * size,
        colour="dark",
    )
    return (drum("z", 0.03 * size, 0.03 * size, (0.0, 0.0, -0.025 * size)), palm, *fingers, *thumb)
