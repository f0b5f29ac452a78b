"""`solve_levels`: prioritised differential inverse kinematics in closed form.

Inverses of one level's rows: the right inverse (22c), and the SR-inverse (22e).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from jaxtyping import Float64
from scipy.linalg import lapack as _scipy_lapack

from poise.control._rank import RankTreatment

_lapack: Any = cast("Any", _scipy_lapack)  # SciPy's stubs do not know the wrapped routines


def right_inverse(
    jacobian: Float64[np.ndarray, "m n"],
    velocity: Float64[np.ndarray, " m"],
    scale: Float64[np.ndarray, " m"],
    rank: RankTreatment,
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, "n n"]]:
    """Least step that gives a velocity, J^+ v with J^+ = J^T (J J^T)^-1, and the space it fills.

    Equation (22c) of Zhang and Kikuuwe, which has no answer where J J^T cannot be inverted. There,
    directions get the activation that `rank` gives them, from one down to zero.

    LAPACK's `dtrtrs` and its like are kept away from: they wait for threads on a busy machine.

    Args:
        jacobian: J.
        velocity: v.
        scale: what rows are multiplied by where ranks are decided: one over the size that their
            block of rows has in the home posture.
        rank: what happens to directions that are lost.

    Returns:
        The step, and P = J^+ J, which projects on the space that J takes from those below it.
    """
    rows, scaled = jacobian * scale[:, None], velocity * scale
    gram = rows @ rows.T
    shifted = gram.copy()
    shifted.flat[:: len(scale) + 1] -= rank.high * rank.high
    if _lapack.dpotrf(shifted, lower=1, overwrite_a=1)[1] == 0:
        factor = _lapack.dpotrf(gram, lower=1)[0]
        inverse_factor = _lapack.dtrtri(factor, lower=1)[0]
        basis = inverse_factor @ rows
        return basis.T @ (inverse_factor @ scaled), basis.T @ basis
    squares, directions = np.linalg.eigh(gram)
    _, gain = rank.activate(squares)
    turned = directions.T @ rows
    inverse = turned.T * gain
    return inverse @ (directions.T @ scaled), inverse @ turned


def robust_step(
    jacobian: Float64[np.ndarray, "m n"],
    velocity: Float64[np.ndarray, " m"],
    weight: Float64[np.ndarray, " m"],
) -> Float64[np.ndarray, " n"]:
    """The step J^# v of the singularity-robust inverse J^# = (J^T W J + I)^-1 J^T W.

    Equation (22e) of Zhang and Kikuuwe: it minimises |J x - v|^2_W + |x|^2, so that |x| is at most
    sqrt(w) |v| / 2 for a weight w, singular or not. It is found as B^T (B B^T + I)^-1 sqrt(W) v
    with B = sqrt(W) J, which is the same.

    Args:
        jacobian: J.
        velocity: v.
        weight: diagonal of W, not negative.
    """
    root = np.sqrt(weight)
    rows = jacobian * root[:, None]
    gram = rows @ rows.T
    gram.flat[:: len(root) + 1] += 1.0
    return rows.T @ _lapack.dposv(gram, root * velocity, lower=1)[1]


RANK = RankTreatment(low=0.005, high=0.02)
"""Rank treatment of velocities: exact to within a fiftieth of the mobility in the home posture.

Closer to singularities than accelerations are followed, because velocities are bounded afterwards
and nothing is divided by them again."""


class VelocityLevel(NamedTuple):
    """Rows J u = v of one priority.

    Attributes:
        jacobian: J, maps joint velocities to the rows' velocities.
        velocity: v, the reference.
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
