"""A QP whose active rows are known: one linear system, and a check of every condition.

From one tick to the next the active rows seldom change. With those of the last tick as equalities
`E x = b`, the optimality conditions are

    [ H  E^T ] [   x   ]   [ -g ]
    [ E   0  ] [ force ] = [  b ]

and x is the optimum if it meets every other row and no force pulls. Otherwise the rows changed.
"""

from typing import Any

import numpy as np
from jaxtyping import Float64
from scipy.linalg import blas, lapack

_blas: Any = blas  # SciPy's stubs do not know the wrapped routines
_lapack: Any = lapack

BALANCE_TOLERANCE = 1e-8
"""Largest `|H x + g + [I; A]^T multipliers|`, relative to the terms that cancel in it."""

_TOLERANCE = 1e-10
"""Largest violation of a row in the row's own units; a tenth of what a solve is checked for."""


class KnownActive:
    """The rows that were active at an optimum, tried again on new numbers of the same shape.

    The system is factored by LU: OpenBLAS runs it in the caller's thread at these sizes, whereas
    its triangular solves with many right-hand sides, which a Cholesky factor would need, wake
    threads that take milliseconds on a busy machine.

    Args:
        multipliers: of that optimum, over bounds and rows.
        n: number of variables.
        bounds: number of simple bounds, on the first variables.
        refines: whether H's curvatures lie so far apart that what is small in x would be lost to
            rounding but for a step of refinement.
    """

    def __init__(
        self, multipliers: Float64[np.ndarray, " nm"], n: int, bounds: int, *, refines: bool
    ) -> None:
        self._rows = np.flatnonzero(multipliers)
        self._below = multipliers[self._rows] < 0.0
        simple = self._rows[self._rows < bounds]
        first, size = n + len(simple), n + len(self._rows)
        self._general = self._rows[len(simple) :] - bounds
        self._general_rows = np.zeros((len(self._general), n))
        self._matrix = np.zeros((size, size))
        self._matrix[np.arange(n, first), simple] = 1.0
        self._matrix[simple, np.arange(n, first)] = 1.0
        self._hessian = self._matrix[:n, :n]
        self._in_rows, self._in_columns = self._matrix[first:, :n], self._matrix[:n, first:]
        self._right = np.zeros(size)
        self._pull, self._b = self._right[:n], self._right[n:]
        self._n, self._bounds, self._refines = n, bounds, refines
        self._values = np.zeros(len(multipliers))
        self._row_values = self._values[bounds:]
        self._excess = np.zeros(len(multipliers))

    def solve(
        self,
        H: Float64[np.ndarray, "n n"],
        g: Float64[np.ndarray, " n"],
        A: Float64[np.ndarray, "m n"],
        lower: Float64[np.ndarray, " nm"],
        upper: Float64[np.ndarray, " nm"],
    ) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " nm"]] | None:
        """Return the optimum and its multipliers, unless other rows are active.

        None where some force pulls; whether all rows hold is for `meets_rows` or the caller.
        """
        rows = A.take(self._general, 0, self._general_rows, "clip")
        self._hessian[:], self._in_rows[:], self._in_columns[:] = H, rows, rows.T
        # Symmetric, so that the transpose is the matrix in LAPACK's order.
        factors, pivots, failed = _lapack.dgetrf(self._matrix.T)
        if failed:
            return None
        self._factors = factors, pivots
        at_lower = lower.take(self._rows)
        upper.take(self._rows, 0, self._b, "clip")
        self._one_sided = at_lower != self._b
        self._may_pull = bool(np.count_nonzero(self._one_sided))
        if self._may_pull:
            np.copyto(self._b, at_lower, where=self._below)
        self._given = A, lower, upper
        return self.again(g)

    def again(
        self, g: Float64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " nm"]] | None:
        """As `solve`, with another gradient in the problem that was solved last."""
        np.negative(g, out=self._pull)
        right, factors = self._right, self._factors
        both = _lapack.dgetrs(*factors, right)[0]
        rest = _blas.dgemv(-1.0, self._matrix.T, both, 1.0, right)
        size = _blas.dnrm2(right)
        # NaN and infinity end here.
        if not (size < np.inf and _blas.dnrm2(rest) <= BALANCE_TOLERANCE * max(size, 1.0)):
            return None
        if self._refines:
            both += _lapack.dgetrs(*factors, rest)[0]
        x, force = both[: self._n], both[self._n :]
        if self._may_pull and (((force > 0.0) == self._below) & self._one_sided).any():
            return None
        multipliers = np.zeros(len(self._values))
        multipliers[self._rows] = force
        return x, multipliers

    def meets_rows(self, x: Float64[np.ndarray, " n"]) -> bool:
        """Whether a point meets every bound and row of the problem that was solved last."""
        A, lower, upper = self._given
        values, excess = self._values, self._excess
        values[: self._bounds] = x[: self._bounds]
        np.dot(A, x, out=self._row_values)
        np.subtract(values, upper, out=excess)
        np.subtract(lower, values, out=values)
        return bool(np.maximum(excess, values, out=excess).max() <= _TOLERANCE)
