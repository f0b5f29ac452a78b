"""How big and how heavy a parametric humanoid is, and how its joints are shared out."""

from dataclasses import dataclass

LEG_JOINTS = 6
"""Joints of a leg: hip yaw, roll, pitch, knee, ankle pitch, roll."""

JOINTS = range(20, 61)
"""Numbers of joints that a humanoid can have."""

_FULL_ARM = 8
_FULL_UNCONSTRAINED = 21


@dataclass(frozen=True, kw_only=True)
class Proportions:
    """Size and mass of a humanoid. Lengths not named here scale with the height."""

    height: float  # from sole to crown, knees straight [m]
    mass: float  # total mass [kg]
    sole_length: float  # length of a foot [m]
    sole_width: float  # width of a foot [m]
    hip_offset: float  # from the middle to a hip [m]
    hip_height: float = 0.494  # height of the hips over the soles, over the height
    leg_mass_ratio: float = 0.45  # mass of both legs over the whole
    accent: str = "accent"  # colour of the covers

    @property
    def scale(self) -> float:
        """Size against a person of 1.8 m."""
        return self.height / 1.8

    @property
    def strength(self) -> float:
        """Joint torques against those of a person of 1.8 m and 100 kg."""
        return self.scale * self.mass / 100.0


@dataclass(frozen=True, kw_only=True)
class JointCount:
    """Joints of each part of a humanoid."""

    arm: int  # joints of one arm
    waist: int  # joints between pelvis and torso
    head: int  # joints between torso and head


def share_joints(total: int) -> JointCount:
    """Share the joints beyond the legs between arms, waist and head.

    33 joints give arms of 8, a waist of 3 and a head of 2. With fewer, the arms shrink to 4 first
    and then the waist and the head; with more, all three grow.
    """
    free = total - 2 * LEG_JOINTS
    if free <= _FULL_UNCONSTRAINED:
        arm = max(4, (free - 4) // 2)
        rest = free - 2 * arm
        head = rest // 2
    else:
        arm = _FULL_ARM + (free - _FULL_UNCONSTRAINED) // 3
        rest = free - 2 * arm
        head = 2 + (rest - 5) // 3
    return JointCount(arm=arm, waist=rest - head, head=head)
