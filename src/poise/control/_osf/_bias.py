"""The bias acceleration of a task: what tasks above it do to it, by four formulas."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.control._osf._rank import PHYSICS_RANK, invert


@dataclass(frozen=True, slots=True, eq=False)
class PrioritisedTask:
    """What all formulas share about task i, in the letters of (Park, Jin, Kang 2022).

    Attributes:
        J: J_i.
        J_p: J_i|p = J_i N_i, eq. (5).
        Lambda_p: Lambda_i|p, eq. (8).
        Lambda_p_inverse: Lambda_i|p^-1, the inverse of `Lambda_p` where that has lost rank too.
        Jbar_p: Jbar_i|p, eq. (7).
        drift: Jdot_i v.
        drift_p: Jdot_i|p v.
        mu_p: mu_i|p + p_i|p, eqs (11) and (12).
        scale: scale of each row, as in `LevelRows`.
    """

    J: Float64[np.ndarray, "m n"]
    J_p: Float64[np.ndarray, "m n"]
    Lambda_p: Float64[np.ndarray, "m m"]
    Lambda_p_inverse: Float64[np.ndarray, "m m"]
    Jbar_p: Float64[np.ndarray, "n m"]
    drift: Float64[np.ndarray, " m"]
    drift_p: Float64[np.ndarray, " m"]
    mu_p: Float64[np.ndarray, " m"]
    scale: Float64[np.ndarray, " m"]


def bias_original(
    task: PrioritisedTask,
    M_inverse: Float64[np.ndarray, "n n"],
    Gamma_above: Float64[np.ndarray, " n"],
    h: Float64[np.ndarray, " n"],
) -> Float64[np.ndarray, " m"]:
    """Eq. (23), with (20) to (22): from torques.

    J_i M^-1 sum Gamma_j + Lambda_i|p^-1 (mu_i|p + p_i|p) - Lambda_i^-1 (mu_i + p_i).

    Args:
        task: the task.
        M_inverse: M^-1.
        Gamma_above: sum of the torques of the tasks above.
        h: V + G.
    """
    J_Minv = task.J.dot(M_inverse)
    Lambda_inverse = J_Minv.dot(task.J.T)
    # Lambda_i appears with its inverse only: nothing may be lost of it that Lambda_i|p still has.
    Lambda, _ = invert(Lambda_inverse, task.scale, PHYSICS_RANK)
    mu = Lambda.dot(J_Minv.dot(h) - task.drift)
    bias = J_Minv.dot(Gamma_above)
    bias += task.Lambda_p_inverse.dot(task.mu_p)
    bias -= Lambda_inverse.dot(mu)
    return bias


def bias_proposed(
    task: PrioritisedTask, S_above: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, " m"]:
    """Eq. (31): from accelerations.

    J_i sum Jbar_j|p (xdd_j|p,ref - Jdot_j|p v) + Jdot_i v - Jdot_i|p v.

    Args:
        task: the task.
        S_above: the sum, over the tasks above.
    """
    bias = task.J.dot(S_above)
    bias += task.drift
    bias -= task.drift_p
    return bias


def bias_fused(
    J: Float64[np.ndarray, "m n"],
    drift: Float64[np.ndarray, " m"],
    S_above: Float64[np.ndarray, " n"],
) -> Float64[np.ndarray, " m"]:
    """Bias acceleration and prioritised velocity term in one: J_i S_i-1 + Jdot_i v.

    xdd_i,ref minus it is alpha_i = xdd_i|p,ref - Jdot_i|p v, all that the torque needs; no
    derivative of a projected Jacobian appears, see `FusedResolver`.

    Args:
        J: J_i.
        drift: Jdot_i v.
        S_above: S_i-1.
    """
    bias = J.dot(S_above)
    bias += drift
    return bias
