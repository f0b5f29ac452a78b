"""A leg of the parametric humanoid: six joints, three of them crossing in the hip.

An arm of the parametric humanoid: four joints or more between the torso and the hand.
"""

from dataclasses import dataclass
from typing import Literal

from poise.robots._parametric._proportions import Proportions
from poise.robots._parametric._solids import Shape, box, capsule, drum, slab, sphere
from poise.robots._parametric._tree import Tree, degrees


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
"""The clavicle joint's distance from the middle, over the shoulder's."""

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


ANKLE_HEIGHT = 0.10
"""Height of the ankle over the sole of a robot of 1.8 m [m]."""

SOLE_FORWARD = 0.03
"""How far the middle of the sole lies before the ankle of a robot of 1.8 m [m]."""

_SOLE_THICKNESS = 0.03


@dataclass(frozen=True, kw_only=True)
class _LegJoint:
    name: str
    axis: Literal["x", "y", "z"]
    span: tuple[float, float]
    torque: float
    mass_share: float


_JOINTS = (
    _LegJoint(name="hip_yaw", axis="z", span=(-35.0, 55.0), torque=150.0, mass_share=0.085),
    _LegJoint(name="hip_roll", axis="x", span=(-30.0, 60.0), torque=250.0, mass_share=0.105),
    _LegJoint(name="hip_pitch", axis="y", span=(-125.0, 50.0), torque=280.0, mass_share=0.37),
    _LegJoint(name="knee", axis="y", span=(0.0, 150.0), torque=300.0, mass_share=0.25),
    _LegJoint(name="ankle_pitch", axis="y", span=(-80.0, 50.0), torque=200.0, mass_share=0.045),
    _LegJoint(name="ankle_roll", axis="x", span=(-40.0, 40.0), torque=110.0, mass_share=0.145),
)


def add_leg(tree: Tree, side: Literal["left", "right"], p: Proportions) -> None:
    """Hang a leg on the pelvis: hip yaw, roll, pitch, knee, ankle pitch, roll.

    Spans are written for the left leg and mirrored for the right: yaw and roll change sign.

    Args:
        tree: the robot, with its pelvis.
        side: which leg.
        p: size and mass.
    """
    sign = 1.0 if side == "left" else -1.0
    mass = p.mass * p.leg_mass_ratio / 2.0
    free = p.hip_height * p.height - ANKLE_HEIGHT * p.scale
    thigh, shin = 0.505 * free, 0.495 * free
    drops = (0.0, 0.0, 0.0, thigh, shin, 0.0)
    shapes = (
        _hip_yaw(p),
        _hip_roll(p),
        _thigh(p, thigh, sign),
        _shin(p, shin),
        (drum("y", 0.035 * p.scale, 0.10 * p.scale),),
        _foot(p),
    )
    links = ("hip_yaw_link", "hip_roll_link", "thigh_link", "shin_link", "ankle_link", "foot_link")
    parent = "pelvis_link"
    for joint, drop, link, look in zip(_JOINTS, drops, links, shapes, strict=True):
        low, high = degrees(*joint.span)
        mirrored = sign < 0.0 and joint.axis != "y"
        child = f"{side}_{link}"
        tree.connect(
            f"{side}_{joint.name}",
            parent,
            child,
            at=(0.0, sign * p.hip_offset, 0.0) if parent == "pelvis_link" else (0.0, 0.0, -drop),
            axis=joint.axis,
            span=(-high, -low) if mirrored else (low, high),
            torque=joint.torque * p.strength,
            velocity=12.0,
        )
        tree.add(child, mass * joint.mass_share, look)
        parent = child


def _hip_yaw(p: Proportions) -> tuple[Shape, ...]:
    s = p.scale
    return (
        drum("z", 0.062 * s, 0.07 * s, (0.0, 0.0, 0.045 * s)),
        box((0.03 * s, 0.08 * s, 0.07 * s), (-0.075 * s, 0.0, 0.0), colour="dark"),
    )


def _hip_roll(p: Proportions) -> tuple[Shape, ...]:
    s = p.scale
    return (drum("x", 0.052 * s, 0.15 * s), sphere(0.06 * s, colour="dark"))


def _thigh(p: Proportions, length: float, sign: float) -> tuple[Shape, ...]:
    s = p.scale
    knee = (0.0, 0.0, -length)
    return (
        drum("y", 0.058 * s, 0.155 * s),
        *capsule((0.0, 0.0, -0.06 * s), (0.0, 0.0, -0.55 * length), 0.075 * s),
        *capsule((0.0, 0.0, -0.5 * length), (0.0, 0.0, -0.88 * length), 0.06 * s),
        box(
            (0.10 * s, 0.012 * s, 0.45 * length),
            (0.0, sign * 0.074 * s, -0.36 * length),
            colour=p.accent,
        ),
        drum("y", 0.045 * s, 0.13 * s, knee),
    )


def _shin(p: Proportions, length: float) -> tuple[Shape, ...]:
    s = p.scale
    return (
        drum("y", 0.052 * s, 0.085 * s, colour="dark"),
        box((0.03 * s, 0.075 * s, 0.09 * s), (0.048 * s, 0.0, 0.0), colour=p.accent),
        *capsule((0.0, 0.0, -0.07 * s), (0.0, 0.0, -0.5 * length), 0.057 * s),
        *capsule((0.0, 0.0, -0.45 * length), (0.0, 0.0, -0.86 * length), 0.043 * s),
        drum("y", 0.036 * s, 0.085 * s, (0.0, 0.0, -length)),
    )


def _foot(p: Proportions) -> tuple[Shape, ...]:
    s = p.scale
    ground, middle = -ANKLE_HEIGHT * s, SOLE_FORWARD * s
    length, width, thick = p.sole_length, p.sole_width, _SOLE_THICKNESS * s
    upper = 0.62 * length
    return (
        drum("x", 0.033 * s, 0.11 * s),
        box((length, width, thick), (middle, 0.0, ground + thick / 2.0), colour="dark", solid=True),
        *slab(
            (upper, 0.86 * width, 0.035 * s),
            (middle - 0.05 * length, 0.0, ground + thick + 0.0175 * s),
            0.025 * s,
        ),
        box(
            (0.24 * length, 0.8 * width, 0.022 * s),
            (middle + 0.34 * length, 0.0, ground + thick + 0.011 * s),
            colour=p.accent,
        ),
    )
