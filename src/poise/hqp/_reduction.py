"""The affine space that is left, `x = point + basis y`, and the inequalities still held in it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from jaxtyping import Bool, Float64, Int

from poise.hqp._problem import HierarchicalProblem
from poise.hqp._tolerances import PIVOT_RANK, PROJECTION_RANK

_linalg: Any = scipy.linalg  # its stubs do not tell the modes of qr apart


@dataclass(frozen=True, slots=True)
class Rows:
    """Two-sided rows `lower <= A y <= upper`."""

    A: Float64[np.ndarray, "k d"]
    lower: Float64[np.ndarray, " k"]
    upper: Float64[np.ndarray, " k"]


class Reduction:
    """What the levels resolved so far leave over.

    Attributes:
        point: a point that meets everything held so far; `y = 0`.
        basis: orthonormal directions in which x may still move.
        held: stacked indices of the inequalities that must keep holding.
        fixed: which stacked rows hold as equalities, at their value at `point`.
    """

    def __init__(self, problem: HierarchicalProblem) -> None:
        n = problem.n
        self.problem = problem
        self.coefficients = np.vstack([np.eye(n), problem.A])
        self.norms = np.linalg.norm(self.coefficients, axis=1)
        # A row without bounds asks for nothing.
        self.bounded = np.isfinite(problem.lower) | np.isfinite(problem.upper)
        self.point = np.zeros(n)
        self.basis = np.eye(n)
        self.held = np.zeros(0, dtype=np.int64)
        self.fixed = np.zeros(n + problem.m, dtype=np.bool_)

    @property
    def freedom(self) -> int:
        """Number of directions left."""
        return self.basis.shape[1]

    def level_rows(self, level: int) -> Int[np.ndarray, " k"]:
        """Return the stacked indices of a level's bounded rows."""
        return np.flatnonzero((self.problem.level_of == level) & self.bounded)

    def rows(self, indices: Int[np.ndarray, " k"]) -> Rows:
        """Return rows in y. What projection left of dependent rows is set to zero exactly."""
        A = self.coefficients[indices] @ self.basis
        gone = np.linalg.norm(A, axis=1) <= PROJECTION_RANK * self.norms[indices]
        A[gone] = 0.0
        offset = self.coefficients[indices] @ self.point
        return Rows(A, self.problem.lower[indices] - offset, self.problem.upper[indices] - offset)

    def held_rows(self, slop: float = 0.0) -> Rows:
        """Return the held inequalities in y, widened by rounding so that `y = 0` meets them.

        Args:
            slop: further widening, relative to the rows' size.
        """
        rows = self.rows(self.held)
        room = slop * np.maximum(1.0, self.norms[self.held] * float(np.linalg.norm(self.point)))
        return Rows(rows.A, np.minimum(rows.lower, 0.0) - room, np.maximum(rows.upper, 0.0) + room)

    def move(self, y: Float64[np.ndarray, " d"]) -> None:
        """Make `point + basis y` the new point."""
        self.point = self.point + self.basis @ y

    def fix(self, indices: Int[np.ndarray, " k"]) -> None:
        """Make rows equalities at their value at the point, and shrink the basis."""
        self.fixed[indices] = True
        self.held = self.held[~self.fixed[self.held]]
        A = self.rows(indices).A
        sizes = np.linalg.norm(A, axis=1)
        normals = A[sizes > 0.0] / sizes[sizes > 0.0, None]
        if len(normals) == 0:
            return
        q, r, _ = _linalg.qr(normals.T, pivoting=True, check_finite=False)
        rank = int(np.count_nonzero(np.abs(np.diagonal(r)) > PIVOT_RANK))
        self.basis = self.basis @ q[:, rank:]

    def hold(self, indices: Int[np.ndarray, " k"], equality: Bool[np.ndarray, " k"]) -> None:
        """Take rows into account from now on: equalities are fixed, the others are held."""
        self.held = np.concatenate([self.held, indices[~equality]])
        if equality.any():
            self.fix(indices[equality])
