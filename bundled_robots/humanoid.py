"""The parametric humanoid: any number of joints from 20 to 60, one look, one mass."""

from bundled_robots.limbs import add_arm, add_leg
from bundled_robots.proportions import Proportions, share_joints
from bundled_robots.tree import Tree
from bundled_robots.trunk import (
    HEAD_HEIGHT,
    add_column,
    head_shapes,
    pelvis_shapes,
    torso_shapes,
)

TOCABI_CLASS = Proportions(
    height=1.8, mass=100.0, sole_length=0.28, sole_width=0.14, hip_offset=0.1025
)
"""Height and mass of the 33-joint humanoid of (Ahn et al. 2024)."""

TELEOPERATED_BIPED = Proportions(
    height=1.62,
    mass=65.0,
    sole_length=0.30,
    sole_width=0.24,
    hip_offset=0.135,
    hip_height=0.48,
    leg_mass_ratio=0.48,
    accent="blue",
)
"""The robot of (Zhang, Kikuuwe, "COM Shifter and Body Rotator")."""

_WAIST_START, _WAIST_LENGTH, _NECK_LENGTH = 0.13, 0.09, 0.07
"""From the hips to the waist, through the waist, through the neck, at a height of 1.8 m [m]."""

_PELVIS_SHARE, _WAIST_SHARE, _TORSO_SHARE, _HEAD_SHARE = 0.12, 0.04, 0.19, 0.05
_ARMS_SHARE = 0.15
"""Shares of the mass; those of the upper body are scaled when the legs weigh more or less."""

_UPPER_SHARE = _PELVIS_SHARE + _WAIST_SHARE + _TORSO_SHARE + _HEAD_SHARE + _ARMS_SHARE


def humanoid(name: str, joints: int, proportions: Proportions) -> Tree:
    """A humanoid with 6 joints a leg, and the others shared between arms, waist and head.

    The root is the pelvis, midway between the hips; x is forward and z up; all angles zero means
    that it stands straight with its arms hanging.
    """
    p, count = proportions, share_joints(joints)
    s = p.scale
    upper = p.mass * (1.0 - p.leg_mass_ratio) / _UPPER_SHARE
    # The height fixes what is left for the torso when the legs are longer or shorter.
    rest = _WAIST_START + _WAIST_LENGTH + _NECK_LENGTH + HEAD_HEIGHT
    torso_height = (1.0 - p.hip_height) * p.height - rest * s
    tree = Tree(name)
    tree.add("pelvis_link", upper * _PELVIS_SHARE, pelvis_shapes(p))
    for side in ("left", "right"):
        add_leg(tree, side, p)
    spare = add_column(
        tree,
        part="waist",
        start=("pelvis_link", _WAIST_START * s),
        end="torso_link",
        count=count.waist,
        length=_WAIST_LENGTH * s,
        radius=0.075 * s,
        mass=upper * _WAIST_SHARE,
        strength=p.strength,
    )
    tree.add("torso_link", upper * _TORSO_SHARE + spare, torso_shapes(p, torso_height))
    for side in ("left", "right"):
        add_arm(
            tree,
            side,
            joints=count.arm,
            parent="torso_link",
            shoulder=(0.0, 0.225 * s, torso_height - 0.07 * s),
            length=0.55 * s,
            mass=upper * _ARMS_SHARE / 2.0,
            strength=p.strength,
            accent=p.accent,
        )
    neck_mass = 0.25 * upper * _HEAD_SHARE
    spare = add_column(
        tree,
        part="neck",
        start=("torso_link", torso_height),
        end="head_link",
        count=count.head,
        length=_NECK_LENGTH * s,
        radius=0.045 * s,
        mass=neck_mass,
        strength=p.strength,
    )
    tree.add("head_link", upper * _HEAD_SHARE - neck_mass + spare, head_shapes(p))
    return tree
