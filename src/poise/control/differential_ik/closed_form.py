"""`solve_levels`: prioritised differential inverse kinematics in closed form."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise.control.differential_ik.inverses import right_inverse, robust_step
from poise.control.osf.rank import RankTreatment

RANK = RankTreatment(low=0.005, high=0.02)
"""Rank treatment of velocities: exact to within a fiftieth of the mobility in the home posture.

Closer to singularities than accelerations are followed, because velocities are bounded afterwards
and nothing is divided by them again."""


class VelocityLevel(NamedTuple):
    """Rows J u = v of one priority.

    Attributes:
        jacobian: J, maps joint velocities to the rows' velocities.
        velocity: v, wanted.
        weight: diagonal of W_A, for levels that give way; not negative.
        scale: what rows are multiplied by where ranks are decided, see `right_inverse`.
    """

    jacobian: Float64[np.ndarray, "m n"]
    velocity: Float64[np.ndarray, " m"]
    weight: Float64[np.ndarray, " m"]
    scale: Float64[np.ndarray, " m"]


def solve_levels(
    levels: Sequence[VelocityLevel],
    joint_weight: Float64[np.ndarray, " n"],
    *,
    exact: int = 1,
    rank: RankTreatment = RANK,
) -> Float64[np.ndarray, " n"]:
    """Joint velocities that serve levels in strict order.

    For two levels, one of them exact, this is (21) with (22) of Zhang and Kikuuwe, "COM Shifter and
    Body Rotator for Step-by-Step Teleoperation of Bipedal Robots", which solves

        min |J_2 u - v_2|^2_WA + |u|^2_WB    subject to J_1 u = v_1                         (20)

    With more levels each does the same over what those above leave it: in z = W_B^1/2 u, with
    A_i = J_i W_B^-1/2 N_i and r_i = v_i - J_i W_B^-1/2 z,

        z <- z + N_i A_i^+ r_i  or  z + N_i A_i^# r_i        N_i+1 = N_i (I - A_i^+ A_i)

    where the first `exact` levels take the right inverse and the others the SR-inverse. What the
    SR-inverse leaves of its level is not filled by those below.

    Args:
        levels: most important first; levels without rows are passed over.
        joint_weight: diagonal of W_B, positive; infinite for joints that must not move.
        exact: how many levels, from the top, are met exactly where that is possible.
        rank: what happens to directions that are lost.

    Returns:
        Joint velocities u [rad/s].
    """
    shrink = 1.0 / np.sqrt(joint_weight)
    z = np.zeros(len(shrink))
    free: Float64[np.ndarray, "n n"] | None = None
    for i, level in enumerate(levels):
        if not len(level.velocity):
            continue
        jacobian = level.jacobian * shrink
        missing = level.velocity - jacobian @ z
        rows = jacobian if free is None else jacobian @ free
        last = i == len(levels) - 1
        if i < exact:
            step, filled = right_inverse(rows, missing, level.scale, rank)
        else:
            step = robust_step(rows, missing, level.weight)
            filled = None if last else right_inverse(rows, missing, level.scale, rank)[1]
        z += step if free is None else free @ step
        if filled is not None and not last:
            free = np.eye(len(z)) - filled if free is None else free - free @ filled
    return shrink * z
