"""A leg of the parametric humanoid: six joints, three of them crossing in the hip.

An arm of the parametric humanoid: four joints or more between the torso and the hand.
"""

from typing import Literal, NamedTuple

from bundled_robots.proportions import Proportions
from bundled_robots.solids import Shape, box, capsule, drum, slab, sphere
from bundled_robots.tree import Hinge, Tree


class _ArmJoint(NamedTuple):
    """A joint of the arm; `station` is its place between shoulder, 0, and wrist, 1."""

    station: float
    hinge: Hinge


_CLAVICLE = Hinge("clavicle", "z", (-30.0, 30.0), 100.0)

_CORE = (
    _ArmJoint(0.0, Hinge("shoulder_pitch", "y", (-170.0, 60.0), 100.0)),
    _ArmJoint(0.0, Hinge("shoulder_roll", "x", (-15.0, 165.0), 100.0)),
    _ArmJoint(0.2, Hinge("shoulder_yaw", "z", (-95.0, 95.0), 60.0)),
    _ArmJoint(0.52, Hinge("elbow", "y", (-145.0, 5.0), 80.0)),
    _ArmJoint(0.66, Hinge("forearm_yaw", "z", (-120.0, 120.0), 40.0)),
    _ArmJoint(1.0, Hinge("wrist_pitch", "y", (-80.0, 80.0), 25.0)),
    _ArmJoint(1.0, Hinge("wrist_roll", "x", (-60.0, 60.0), 25.0)),
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
            0.1 + 0.85 * (i + 0.5) / extra,
            Hinge(f"hinge{i + 1}", "x" if i % 2 == 0 else "y", (-30.0, 30.0), 60.0),
        )
        for i in range(extra)
    )
    return tuple(sorted((*core, *hinges), key=lambda j: j.station))


def add_arm(
    tree: Tree,  # the robot, with the link `parent`
    side: Literal["left", "right"],  # which arm
    *,
    joints: int,  # number of joints, at least 4
    parent: str,  # the link that carries the arm
    shoulder: tuple[float, float, float],  # place of the left shoulder in the parent [m]
    length: float,  # from shoulder to wrist [m]
    mass: float,  # mass of the arm [kg]
    strength: float,  # torque limits against those of a robot of 1.8 m and 100 kg
    accent: str,  # colour of the covers
) -> None:
    """Hang an arm on the torso. All angles zero means that it hangs straight down."""
    sign = 1.0 if side == "left" else -1.0
    size = length / 0.55
    chain = arm_joints(joints)
    ends = [j.station for j in chain[1:]] + [1.0]
    spans = [(end - j.station) * length for j, end in zip(chain, ends, strict=True)]
    has_clavicle = joints > len(_CORE)
    weights = [_JOINT_WEIGHT + _LENGTH_WEIGHT * span / length for span in spans]
    parts = sum(weights) + _HAND_WEIGHT + (_JOINT_WEIGHT if has_clavicle else 0.0)
    unit = mass / parts
    x, y, z = shoulder
    at = (x, sign * y, z)
    if has_clavicle:
        root = _CLAVICLE_OFFSET * y
        child = f"{side}_clavicle_link"
        place = (x, sign * root, z)
        tree.connect(
            _CLAVICLE, parent, child, at=place, velocity=10.0, strength=strength, side=side
        )
        tree.add(child, unit * _JOINT_WEIGHT, _clavicle_shapes(size, sign * (y - root)))
        parent, at = child, (0.0, sign * (y - root), 0.0)
    for i, (joint, span) in enumerate(zip(chain, spans, strict=True)):
        child = f"{side}_{joint.hinge.name}_link"
        tree.connect(joint.hinge, parent, child, at=at, velocity=10.0, strength=strength, side=side)
        tree.add(child, unit * weights[i], _segment_shapes(joint, span, size, sign, accent))
        parent, at = child, (0.0, 0.0, -span)
    tree.weld(parent, f"{side}_hand_link", at=at)
    tree.add(f"{side}_hand_link", unit * _HAND_WEIGHT, _hand_shapes(size, sign))


def _clavicle_shapes(size: float, reach: float) -> tuple[Shape, ...]:
    return (
        drum("z", 0.05 * size, 0.10 * size),
        *capsule((0.0, 0.0, 0.0), (0.0, 0.8 * reach, 0.0), 0.043 * size, colour="dark"),
    )


def _segment_shapes(
    joint: _ArmJoint, span: float, size: float, sign: float, accent: str
) -> tuple[Shape, ...]:
    radius = (0.056 - 0.018 * joint.station) * size
    if joint.hinge.name == "shoulder_pitch":
        return (
            drum("y", 0.058 * size, 0.09 * size),
            sphere(0.072 * size, (0.0, sign * 0.018 * size, 0.018 * size), colour=accent),
        )
    if joint.hinge.axis == "z":
        ring = drum("z", 1.04 * radius, 0.022 * size)
    else:
        # Hidden under the shoulder's cover, a hinge across x is shorter.
        ring = drum(
            joint.hinge.axis, 0.85 * radius, (2.25 if joint.station > 0.0 else 1.9) * radius
        )
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


_LEG = (
    ("hip_yaw_link", 0.085, Hinge("hip_yaw", "z", (-35.0, 55.0), 150.0)),
    ("hip_roll_link", 0.105, Hinge("hip_roll", "x", (-30.0, 60.0), 250.0)),
    ("thigh_link", 0.37, Hinge("hip_pitch", "y", (-125.0, 50.0), 280.0)),
    ("shin_link", 0.25, Hinge("knee", "y", (0.0, 150.0), 300.0)),
    ("ankle_link", 0.045, Hinge("ankle_pitch", "y", (-80.0, 50.0), 200.0)),
    ("foot_link", 0.145, Hinge("ankle_roll", "x", (-40.0, 40.0), 110.0)),
)
"""Links of a leg from above: name, fraction of the leg's mass, and the hinge they hang on."""


def add_leg(tree: Tree, side: Literal["left", "right"], p: Proportions) -> None:
    """Hang a leg on the pelvis: hip yaw, roll, pitch, knee, ankle pitch, roll.

    Spans are written for the left leg and mirrored for the right: yaw and roll change sign.
    """
    sign = 1.0 if side == "left" else -1.0
    mass = p.mass * p.leg_mass_ratio / 2.0
    free = p.hip_height * p.height - ANKLE_HEIGHT * p.scale
    thigh, shin = 0.505 * free, 0.495 * free
    hip = (0.0, sign * p.hip_offset, 0.0)
    places = (hip, *((0.0, 0.0, -drop) for drop in (0.0, 0.0, thigh, shin, 0.0)))
    shapes = (
        _hip_yaw(p),
        _hip_roll(p),
        _thigh(p, thigh, sign),
        _shin(p, shin),
        (drum("y", 0.035 * p.scale, 0.10 * p.scale),),
        _foot(p),
    )
    parent = "pelvis_link"
    for (link, fraction, hinge), at, look in zip(_LEG, places, shapes, strict=True):
        child = f"{side}_{link}"
        tree.connect(hinge, parent, child, at=at, velocity=12.0, strength=p.strength, side=side)
        tree.add(child, mass * fraction, look)
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
