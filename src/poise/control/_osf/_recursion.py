"""`OperationalRecursion`: prioritised accelerations, with no projected Jacobian differentiated."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from scipy.linalg import lapack

from poise.control._osf._limits import DemandLimit
from poise.control._osf._rows import LevelRows
from poise.control._rank import RankTreatment, rank_of
from poise.dynamics import Dynamics


class OperationalRecursion:
    """The operational space formulation with its bias velocity terms cancelled.

    With N_1 = I, J_i|p = J_i N_i, Jbar_i = M^-1 J_i|p^T Lambda_i|p and N_i+1 = N_i - Jbar_i J_i|p
    as in eqs (5) to (8) of (Park, Jin, Kang 2022), the sum of the torques (17) under the bias
    acceleration (23) or (31) is

        alpha_i = xdd_i,ref - Jdot_i v - J_i S_i-1        S_0 = 0
        S_i     = S_i-1 + Jbar_i alpha_i
        Gamma   = M S_k + h - N_k+1^T h                   h = V + G

    because alpha_i equals xdd_i|p,ref - Jdot_i|p v: what the projected Jacobian's derivative adds
    to the bias acceleration it takes away again in mu_i|p.

    With M = L L^T and rows J~ = J L^-T, all projections are orthogonal ones. Levels that the robot
    can follow without loss of rank need no projector at all: their stacked rows have one Cholesky
    factor R^T R = J~ J~^T, R's diagonal blocks are the factors of the Lambda_i|p^-1, and the
    recursion above is the substitution with R^T. From the first level that loses rank on, levels
    are taken one by one in the basis of what is left, with activations of directions as
    `RankTreatment` has them; both ways give the same numbers where both apply.

    Args:
        n: number of generalized coordinates.
        rank: what happens where a level below the physics loses rank.
        demand: what happens where a level asks for too much; None for nothing.

    Attributes:
        regular: number of leading levels that kept their rank, and asked for no more than is
            allowed, at the last state.
    """

    def __init__(self, n: int, rank: RankTreatment, demand: DemandLimit | None = None) -> None:
        self._n, self._rank, self._demand = n, rank, demand
        self._levels: Sequence[slice] = ()
        self.regular = 0

    def resolve(self, levels: LevelRows, dynamics: Dynamics) -> Float64[np.ndarray, " n"]:
        """The acceleration of one state.

        Directions that no level decides are left without force: they accelerate by -M^-1 h.

        Args:
            levels: rows of the state, the physics first.
            dynamics: the state.

        Returns:
            The generalized acceleration dv; the force is `M dv + h`.
        """
        self._rows, self._target = levels.scaled()
        self._levels, self._constraints, self._h = levels.slices, levels.constraints, dynamics.h
        # L^-1 outright, and products with it: the routine that solves with L runs on several
        # threads, and waits for all of them on a machine that is busy.
        factor, _ = lapack.dpotrf(dynamics.M.T, lower=1, clean=1)
        self._L_inverse: Float64[np.ndarray, "n n"] = lapack.dtrtri(factor, lower=1, overwrite_c=1)[
            0
        ]
        self._factor()
        if self.regular == len(self._levels):
            return self._all_regular()
        return self._settle(self._tail(self._regular_sum(self.regular)))[-1]

    def steps(self) -> list[Float64[np.ndarray, " n"]]:
        """Accelerations of the last state with one more level each time, `resolve`'s at the end.

        The first has the physics only; directions that later levels decide are held without
        acceleration in it, not let go.
        """
        first = [self._regular_sum(count) for count in range(1, self.regular + 1)]
        rest = self._tail(first[-1] if first else np.zeros(self._n))
        return self._settle([*first, *rest])

    def _factor(self) -> None:
        """Factors the leading levels; stops before the first that loses rank."""
        ends = [level.stop for level in self._levels if level.stop <= self._n]
        end = ends[-1] if ends else 0
        self._tilde: Float64[np.ndarray, "c n"] = self._rows[:end].dot(self._L_inverse.T)
        R, failed = lapack.dpotrf(self._tilde.dot(self._tilde.T).T, lower=0, clean=1, overwrite_a=1)
        if failed:
            end = failed - 1
            R = R[:end, :end]
        self._inverse: Float64[np.ndarray, "c c"] = lapack.dtrtri(R, lower=0)[0] if end else R
        self.regular = 0
        for level in self._levels:
            least = rank_of(self.regular, self._constraints, self._rank).high
            block = (level, level)
            if level.stop > end or not _is_regular(R[block], self._inverse[block], least):
                break
            self.regular += 1
        if self._demand is not None:
            parts = self._each()
            if not self._demand.is_kept(parts):
                self.regular = [self._demand.is_kept(part) for part in parts].index(False)

    def _each(self) -> Float64[np.ndarray, "k n"]:
        """What each regular level adds to the acceleration; zero for constraints."""
        count = self.regular
        end = self._levels[count - 1].stop if count else 0
        inverse = self._inverse[:end, :end]
        coefficients = inverse.T.dot(self._target[:end])
        parts = np.zeros((max(count, 1), end))
        for i, level in enumerate(self._levels[self._constraints : count], start=self._constraints):
            parts[i, level] = coefficients[level]
        return parts.dot(inverse.T).dot(self._tilde[:end]).dot(self._L_inverse)

    def _all_regular(self) -> Float64[np.ndarray, " n"]:
        # Gamma = sum J_i^T F_i with F from J M^-1 (Gamma - h) = target, all levels at once.
        tilde, inverse = self._tilde, self._inverse
        w = self._L_inverse.dot(self._h)
        rhs = tilde.dot(w)
        rhs += self._target
        z = inverse.dot(inverse.T.dot(rhs)).dot(tilde)
        z -= w
        return z.dot(self._L_inverse)

    def _regular_sum(self, count: int) -> Float64[np.ndarray, " n"]:
        """S after a number of regular levels."""
        end = self._levels[count - 1].stop if count else 0
        inverse = self._inverse[:end, :end]
        forces = inverse.dot(inverse.T.dot(self._target[:end]))
        return forces.dot(self._tilde[:end]).dot(self._L_inverse)

    def _tail(self, S: Float64[np.ndarray, " n"]) -> list[Float64[np.ndarray, " n"]]:
        """S after each level from the first that lost rank, given S before it."""
        end = self._levels[self.regular - 1].stop if self.regular else 0
        self._basis = self._complement(self._tilde[:end])
        # What is left of each direction of the basis: N in the mass metric.
        self._left = np.eye(self._basis.shape[1])
        found: list[Float64[np.ndarray, " n"]] = []
        for i, level in enumerate(self._levels[self.regular :], start=self.regular):
            rank = rank_of(i, self._constraints, self._rank)
            rows = self._rows[level]
            A = (rows @ self._basis) @ self._left
            squares, V = np.linalg.eigh(A.T @ A)
            activation, gain = rank.activate(squares)
            projection = V.T @ (A.T @ (self._target[level] - rows @ S))
            motion = self._basis @ V
            if self._demand is not None and i >= self._constraints:
                gain = self._demand.tempered(activation, gain, projection, motion)
            S = S + motion @ (gain * projection)
            self._left -= (V * activation) @ V.T
            found.append(S)
        return found

    def _settle(self, found: list[Float64[np.ndarray, " n"]]) -> list[Float64[np.ndarray, " n"]]:
        """Accelerations dv = S - N M^-1 h: what no level decides is let go."""
        let_go = self._basis @ (self._left @ (self._basis.T @ self._h))
        return [S - let_go for S in found]

    def _complement(self, tilde: Float64[np.ndarray, "c n"]) -> Float64[np.ndarray, "n r"]:
        """Accelerations that leave the leading levels alone, orthonormal in the mass metric."""
        taken, n = tilde.shape
        basis = np.zeros((n, n - taken), order="F")
        basis[taken:] = np.eye(n - taken)
        if taken:
            factor, tau, _, _ = lapack.dgeqrf(tilde.T)
            basis, _, _ = lapack.dormqr("L", "N", factor, tau, basis, 64 * n, overwrite_c=1)
        return self._L_inverse.T.dot(basis)


def _is_regular(
    factor: Float64[np.ndarray, "m m"], inverse: Float64[np.ndarray, "m m"], least: float
) -> bool:
    """Whether all singular values of a triangular block are `least` or more."""
    # The Frobenius norm bounds the largest singular value of the inverse from above, cheaply.
    if np.vdot(inverse, inverse) * least * least <= 1.0:
        return True
    gram = factor.T @ factor
    gram.flat[:: len(gram) + 1] -= least * least
    return lapack.dpotrf(gram, overwrite_a=1)[1] == 0
