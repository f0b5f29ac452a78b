"""The bias acceleration of a task, what tasks above it do to it: by four formulas, to be timed.

As in (Park, Jin, Kang 2022), everything that the torque (17) needs in any case is there already and
does not count: J_i|p, Lambda_i|p and its inverse, Jbar_i|p, mu_i|p + p_i|p, Jdot_i|p v, M^-1, h,
xdd_i,ref, and the sum of the torques above. So is Jdot_i v, which no formula computes here: it
comes with the frames' kinematics, for all formulas alike.

    original    Lambda_i^-1, Lambda_i, mu_i + p_i, J_i M^-1 sum Gamma_j, and their sum      (23)
    original_plain
                the same with a plain inverse for Lambda_i; `original` inverts as all of Poise
                does, ready for tasks that have lost rank
    proposed    the sum of Jbar_j|p (xdd_j|p,ref - Jdot_j|p v) over the tasks above, J_i times
                it, and the velocity terms                                                  (31)
    numerical   (J_i - J_i|p) v and its backward difference                                 (41)
    fused       alpha_j, the sum of Jbar_j|p alpha_j over the tasks above, J_i times it, and
                Jdot_i v
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float64
from scipy.linalg import lapack

from benchmarks.rigid_plant import CONTROL_DT
from poise.control import RankTreatment

FIRM_RANK = RankTreatment(low=1e-5, high=1e-4)
"""Of contacts, which give way nowhere: only what is redundant is dropped."""


@dataclass(frozen=True, slots=True, eq=False)
class PrioritisedTask:
    """Terms that all formulas share about task i, in the letters of (Park, Jin, Kang 2022)."""

    J: Float64[np.ndarray, "m n"]  # J_i
    J_p: Float64[np.ndarray, "m n"]  # J_i|p = J_i N_i, eq. (5).
    Lambda_p: Float64[np.ndarray, "m m"]  # Lambda_i|p, eq. (8).
    # Lambda_i|p^-1, the inverse of `Lambda_p` where that has lost rank too
    Lambda_p_inverse: Float64[np.ndarray, "m m"]
    Jbar_p: Float64[np.ndarray, "n m"]  # Jbar_i|p, eq. (7).
    drift: Float64[np.ndarray, " m"]  # Jdot_i v
    drift_p: Float64[np.ndarray, " m"]  # Jdot_i|p v
    mu_p: Float64[np.ndarray, " m"]  # mu_i|p + p_i|p, eqs (11) and (12)
    scale: Float64[np.ndarray, " m"]  # scale of each row, as in `PaperRows`


def invert(
    matrix: Float64[np.ndarray, "m m"], scale: Float64[np.ndarray, " m"], rank: RankTreatment
) -> tuple[Float64[np.ndarray, "m m"], Float64[np.ndarray, "m m"]]:
    """Inverse of J M^-1 J^T, as far as its rank goes."""
    if not len(scale):
        return matrix, matrix
    scaled = matrix * scale * scale[:, None]
    shifted = scaled.copy()
    shifted.flat[:: len(scale) + 1] -= rank.high * rank.high
    if lapack.dpotrf(shifted, lower=1)[1] == 0:
        factor, _ = lapack.dpotrf(scaled, lower=1)
        inverse, _ = lapack.dpotri(factor, lower=1, overwrite_c=1)
        inverse = np.tril(inverse)
        inverse += np.tril(inverse, -1).T
        return inverse * scale * scale[:, None], matrix
    squares, U = np.linalg.eigh(scaled)
    share, gain = rank.activate(squares)
    kept = np.divide(1.0, gain, out=np.zeros_like(gain), where=share > 0.0)
    shared = ((U * kept) @ U.T) / scale / scale[:, None]
    return ((U * gain) @ U.T) * scale * scale[:, None], shared


def bias_original(
    task: PrioritisedTask,
    M_inverse: Float64[np.ndarray, "n n"],
    Gamma_above: Float64[np.ndarray, " n"],
    h: Float64[np.ndarray, " n"],
    *,
    plain: bool = False,
) -> Float64[np.ndarray, " m"]:
    """Eq. (23), with (20) to (22): from torques.

    J_i M^-1 sum Gamma_j + Lambda_i|p^-1 (mu_i|p + p_i|p) - Lambda_i^-1 (mu_i + p_i).
    """
    J_Minv = task.J.dot(M_inverse)
    Lambda_inverse = J_Minv.dot(task.J.T)
    # Lambda_i appears with its inverse only: nothing may be lost of it that Lambda_i|p still has.
    if plain:
        Lambda = np.linalg.inv(Lambda_inverse)
    else:
        Lambda, _ = invert(Lambda_inverse, task.scale, FIRM_RANK)
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
    derivative of a projected Jacobian appears, see `FusedRecursion`.
    """
    bias = J.dot(S_above)
    bias += drift
    return bias


Biases = list[Float64[np.ndarray, " _"]]
"""Bias accelerations of tasks 2 to k."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BiasTick:
    """One tick's quantities that the torque needs anyway."""

    tasks: list[PrioritisedTask]  # tasks 1 to k
    references: list[Float64[np.ndarray, " _"]]  # xdd_i,ref
    references_p: list[Float64[np.ndarray, " _"]]  # xdd_i|p,ref, by (24)
    # Sum of the torques of the tasks above, for tasks 2 to k
    torques_above: list[Float64[np.ndarray, " n"]]
    M_inverse: Float64[np.ndarray, "n n"]  # M^-1
    h: Float64[np.ndarray, " n"]  # V + G
    v: Float64[np.ndarray, " n"]  # joint velocities
    before: Biases  # (J_i - J_i|p) v of the tick before, for tasks 2 to k


def original(tick: BiasTick, *, plain: bool = False) -> Biases:
    """By (23); `plain` for tasks that have their full rank by themselves."""
    return [
        bias_original(task, tick.M_inverse, above, tick.h, plain=plain)
        for task, above in zip(tick.tasks[1:], tick.torques_above, strict=True)
    ]


def proposed(tick: BiasTick) -> Biases:
    """By (31)."""
    first, *tasks = tick.tasks
    S = first.Jbar_p.dot(tick.references_p[0] - first.drift_p)
    found = [bias_proposed(tasks[0], S)]
    for i in range(1, len(tasks)):
        above = tasks[i - 1]
        S += above.Jbar_p.dot(tick.references_p[i] - above.drift_p)
        found.append(bias_proposed(tasks[i], S))
    return found


def numerical(tick: BiasTick) -> Biases:
    """By (41)."""
    return [
        ((task.J - task.J_p).dot(tick.v) - before) / CONTROL_DT
        for task, before in zip(tick.tasks[1:], tick.before, strict=True)
    ]


def fused(tick: BiasTick) -> Biases:
    """With the prioritised velocity terms cancelled; Jdot_i|p v is in the result."""
    first, *tasks = tick.tasks
    S = first.Jbar_p.dot(tick.references[0] - first.drift)
    bias = bias_fused(tasks[0].J, tasks[0].drift, S)
    found = [bias]
    for i in range(1, len(tasks)):
        task = tasks[i]
        S += tasks[i - 1].Jbar_p.dot(tick.references[i] - bias)
        bias = bias_fused(task.J, task.drift, S)
        found.append(bias)
    return found


FORMULAS: dict[str, Callable[[BiasTick], Biases]] = {
    "original": original,
    "original_plain": partial(original, plain=True),
    "proposed": proposed,
    "numerical": numerical,
    "fused": fused,
}
"""By name; the original first, as the one that others are compared with."""
