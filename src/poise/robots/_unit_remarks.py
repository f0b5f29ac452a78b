"""Numbers that look as if they were in other units: `remark_on_angles`, `remark_on_weight`."""

import math
from collections.abc import Iterable

import pinocchio as pin

from poise._show import few
from poise.robots._kinematics import hinges
from poise.robots._limits import joint_kind
from poise.robots._robot import GRAVITY

_TURNS = 4.0 * math.pi
"""Hardly a joint turns further than twice round [rad]."""

_ENDLESS = 720.0
"""Larger limits than two turns in degrees are written for joints that turn without end."""

_WATER = 1000.0
"""No robot is as heavy as a cube of water as high as two of its legs [kg/m^3]."""

_FAR_TOO_WEAK = 0.01
"""Strongest torque of a leg in weight times leg length: shipped humanoids have 0.15 to 0.5."""


def remark_on_angles(model: pin.Model) -> list[str]:
    """Limits of hinges that only make sense in degrees, as a sentence.

    Args:
        model: the robot's.
    """
    odd: list[str] = []
    for name, joint in hinges(model):
        low = float(model.lowerPositionLimit[joint.idx_q])
        high = float(model.upperPositionLimit[joint.idx_q])
        if joint_kind(joint) == "revolute" and _TURNS < max(abs(low), abs(high)) <= _ENDLESS:
            odd.append(f"{name} ({low:.4g} to {high:.4g})")
    if not odd:
        return []
    return [f"limits beyond two turns, which look like degrees in place of radians: {few(odd)}"]


def remark_on_weight(model: pin.Model, leg: Iterable[int], tall: float) -> list[str]:
    """A mass that a robot of this size cannot have, or that its legs cannot carry, as a sentence.

    Args:
        model: with the torque limits of its file; those that are zero or infinite are unknown.
        leg: joints of the legs.
        tall: from a hip to the sole [m].
    """
    mass = float(pin.computeTotalMass(model))
    if mass > _WATER * (2.0 * tall) ** 3:
        return [
            f"{mass:.0f} kg on legs of {tall:.3g} m, more than so much water: are masses in grams, "
            "or lengths in another unit than metres?"
        ]
    joints = [model.joints[j] for j in leg]
    limits = [float(model.effortLimit[j.idx_v]) for j in joints if joint_kind(j) == "revolute"]
    known = [limit for limit in limits if 0.0 < limit < 1e300]
    needed = _FAR_TOO_WEAK * mass * GRAVITY * tall
    if len(known) < len(limits) or not known or max(known) > needed:
        return []
    return [
        f"the strongest joint of the legs has {max(known):.3g} N m under {mass:.4g} kg on legs of "
        f"{tall:.3g} m, far too little to stand: are torques or masses in other units?"
    ]
