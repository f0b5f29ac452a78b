"""The operational space formulation as its equations stand, and in one substitution.

`PaperRecursion`: eqs (5) to (24) of (Park, Jin, Kang 2022), matrix by matrix.
`FusedRecursion`: with the bias velocity terms cancelled, as `OperationalSpaceController` has it.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from scipy.linalg import lapack

from benchmarks.bias.formulas import (
    FIRM_RANK,
    PrioritisedTask,
    bias_original,
    bias_proposed,
    invert,
)
from benchmarks.bias.rows import BackwardDifferences, PaperRows
from poise.control import RankTreatment
from poise.dynamics import Dynamics
from poise.errors import PoiseError, UnknownNameError

PAPER_FORMULAS = ("original", "proposed", "numerical")
"""Formulas of the bias acceleration: eqs (23), (31) and (41)."""


class PaperRecursion:
    """What the paper's studies run, and what Poise's own recursion is timed against.

    Ranks are treated as Poise treats them. Jdot_i|p is found by backward differences, as in the
    paper.
    """

    def __init__(self, formula: str, rank: RankTreatment | None = None) -> None:
        if formula not in PAPER_FORMULAS:
            raise UnknownNameError("no such bias formula", got=formula, choices=PAPER_FORMULAS)
        self._formula, self._rank = formula, rank or RankTreatment()
        self._rates, self._velocities = BackwardDifferences(), BackwardDifferences()
        # Bias acceleration of each level at the last state
        self.bias: list[Float64[np.ndarray, " m"]] = []
        # What the recursion found for each level at the last state
        self.tasks: list[PrioritisedTask] = []
        self.regular = True  # whether every level kept its rank at the last state

    def resolve(self, rows: PaperRows, dynamics: Dynamics) -> Float64[np.ndarray, " n"]:
        """The acceleration of one state."""
        v, h = dynamics.state.v, dynamics.h
        M_inverse = np.linalg.inv(dynamics.M)
        self._rates.begin(dynamics.state.time)
        self._velocities.begin(dynamics.state.time)
        N = np.eye(len(v))
        Gamma, S = np.zeros(len(v)), np.zeros(len(v))
        self.bias, self.tasks, self.regular = [], [], True
        for i, level in enumerate(rows.slices):
            J, drift = rows.jacobian[level], rows.drift[level]
            J_p = J @ N
            J_p_rate = self._rates.of(J_p)
            # Nothing is projected out of the first level: J_1|p is J_1.
            drift_p = J_p_rate @ v if i else drift
            rank = self._rank if i else FIRM_RANK
            task = self._prioritise(J, J_p, M_inverse, h, drift, drift_p, rows.scale[level], rank)
            bias = self._bias(task, M_inverse, Gamma, S, h, v) if i else np.zeros(len(J))
            # Eq. (24), then (14), (16) and (15).
            reference_p = rows.reference[level] - bias
            Gamma = Gamma + J_p.T @ (task.Lambda_p @ reference_p + task.mu_p)
            S = S + task.Jbar_p @ (reference_p - task.drift_p)
            N = N - task.Jbar_p @ J_p
            self.bias.append(bias)
            self.tasks.append(task)
        return M_inverse @ (Gamma - h)

    def _bias(
        self,
        task: PrioritisedTask,
        M_inverse: Float64[np.ndarray, "n n"],
        Gamma_above: Float64[np.ndarray, " n"],
        S_above: Float64[np.ndarray, " n"],
        h: Float64[np.ndarray, " n"],
        v: Float64[np.ndarray, " n"],
    ) -> Float64[np.ndarray, " m"]:
        if self._formula == "original":
            return bias_original(task, M_inverse, Gamma_above, h)
        if self._formula == "proposed":
            return bias_proposed(task, S_above)
        return self._velocities.of((task.J - task.J_p) @ v)

    def _prioritise(
        self,
        J: Float64[np.ndarray, "m n"],
        J_p: Float64[np.ndarray, "m n"],
        M_inverse: Float64[np.ndarray, "n n"],
        h: Float64[np.ndarray, " n"],
        drift: Float64[np.ndarray, " m"],
        drift_p: Float64[np.ndarray, " m"],
        scale: Float64[np.ndarray, " m"],
        rank: RankTreatment,
    ) -> PrioritisedTask:
        """Eqs (7), (8), (11) and (12)."""
        J_Minv = J_p @ M_inverse
        mobility = J_Minv @ J_p.T
        Lambda, Lambda_inverse = invert(mobility, scale, rank)
        self.regular = self.regular and Lambda_inverse is mobility
        return PrioritisedTask(
            J=J,
            J_p=J_p,
            Lambda_p=Lambda,
            Lambda_p_inverse=Lambda_inverse,
            Jbar_p=J_Minv.T @ Lambda,
            drift=drift,
            drift_p=drift_p,
            mu_p=Lambda @ (J_Minv @ h - drift_p),
            scale=scale,
        )


class FusedRecursion:
    """The recursion that `OperationalSpaceController` documents, where every level keeps its rank.

    With M = L L^T and rows J~ = J L^-T, the stacked rows have one Cholesky factor
    R^T R = J~ J~^T, whose diagonal blocks are the factors of the Lambda_i|p^-1; the sum over the
    tasks is the substitution with R^T. It stands here to be counted and read beside the others.
    """

    def __init__(self, rank: RankTreatment | None = None) -> None:
        self._rank = rank or RankTreatment()

    def resolve(self, rows: PaperRows, dynamics: Dynamics) -> Float64[np.ndarray, " n"]:
        """The acceleration of one state."""
        scaled = rows.jacobian * rows.scale[:, None]
        target = rows.target * rows.scale
        factor, _ = lapack.dpotrf(dynamics.M.T, lower=1, clean=1)
        L_inverse = lapack.dtrtri(factor, lower=1, overwrite_c=1)[0]
        tilde = scaled.dot(L_inverse.T)
        R, failed = lapack.dpotrf(tilde.dot(tilde.T).T, lower=0, clean=1, overwrite_a=1)
        inverse = lapack.dtrtri(R, lower=0)[0]
        if failed or not self._are_regular(R, inverse, rows.slices):
            raise PoiseError("a level has lost rank: the fused recursion has no answer here")
        # Gamma = sum J_i^T F_i with F from J M^-1 (Gamma - h) = target, all levels at once.
        w = L_inverse.dot(dynamics.h)
        rhs = tilde.dot(w)
        rhs += target
        z = inverse.dot(inverse.T.dot(rhs)).dot(tilde)
        z -= w
        return z.dot(L_inverse)

    def _are_regular(
        self,
        R: Float64[np.ndarray, "c c"],
        inverse: Float64[np.ndarray, "c c"],
        levels: Sequence[slice],
    ) -> bool:
        for i, level in enumerate(levels):
            least = (self._rank if i else FIRM_RANK).high
            block = inverse[level, level]
            # The Frobenius norm bounds the largest singular value of the inverse from above.
            if np.vdot(block, block) * least * least <= 1.0:
                continue
            if np.linalg.svd(R[level, level], compute_uv=False).min() < least:
                return False
        return True
