"""A leg of the parametric humanoid: six joints, three of them crossing in the hip."""

from dataclasses import dataclass
from typing import Literal

from poise.robots.parametric.proportions import Proportions
from poise.robots.parametric.shapes import Shape, box, capsule, drum, slab, sphere
from poise.robots.parametric.tree import Tree, degrees

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
    mass = p.mass * p.leg_share / 2.0
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
