"""All rows hard in one DAQP solve, with a workspace that persists and a check that never trusts.

min x^T H x / 2 + g^T x   s.t.   lower <= [x; A x] <= upper
"""

from dataclasses import dataclass

import daqp
import numpy as np
from jaxtyping import Float64

PRIMAL_TOLERANCE = 1e-10
"""DAQP's tolerance on rows it does not hold, in units of `|a R^-1|` where `H = R^T R`."""

STATIONARITY_TOLERANCE = 1e-8
"""Largest `|H x + g + [I; A]^T multipliers|`, relative to the terms that cancel in it."""


@dataclass(frozen=True, slots=True)
class HardPoint:
    """What one hard solve found: point, multipliers, iterations."""

    x: Float64[np.ndarray, " n"]
    multipliers: Float64[np.ndarray, " nm"]
    iterations: int


class HardQP:
    """A DAQP workspace for one shape of problem, warm-started from call to call.

    DAQP keeps the active set of the last solve and the equality flags it was set up with; an
    equality it was not told about it finds itself from equal bounds. So rows are never declared
    as equalities here, and the flags cannot go stale.
    """

    def __init__(self) -> None:
        self._model = daqp.Model()
        self._shape = (-1, -1)

    def reset(self) -> None:
        """Forget everything, so that the next solve starts cold."""
        self._model = daqp.Model()
        self._shape = (-1, -1)

    def solve(
        self,
        H: Float64[np.ndarray, "n n"],
        g: Float64[np.ndarray, " n"],
        A: Float64[np.ndarray, "m n"],
        lower: Float64[np.ndarray, " nm"],
        upper: Float64[np.ndarray, " nm"],
        time_limit: float = 0.0,
    ) -> HardPoint | None:
        """Return the point DAQP calls optimal, unchecked, or None if it found none.

        Args:
            H: Hessian.
            g: gradient at zero.
            A: coefficients of the rows.
            lower: lower bounds of x, then of the rows.
            upper: upper bounds of x, then of the rows.
            time_limit: cap on the solve [s]; 0 for none.
        """
        if A.shape == self._shape:
            # DAQP indexes the first coefficient of what it is given, even where there is none.
            flag = self._model.update(H, g, A if len(A) else None, upper, lower)
        else:
            flag = self._set_up(H, g, A, lower, upper)
        if flag < 0:
            return None
        model = self._model
        if time_limit != self._time_limit:
            self._time_limit = time_limit
            model.settings = {"time_limit": time_limit}
        x, _, flag, info = model.solve()
        if flag < 1:
            return None
        # DAQP answers with its own buffers, which the next solve overwrites.
        return HardPoint(x.copy(), info["lam"].copy(), info["iterations"])

    def _set_up(
        self,
        H: Float64[np.ndarray, "n n"],
        g: Float64[np.ndarray, " n"],
        A: Float64[np.ndarray, "m n"],
        lower: Float64[np.ndarray, " nm"],
        upper: Float64[np.ndarray, " nm"],
    ) -> int:
        self._model = daqp.Model()
        self._model.settings = {"primal_tol": PRIMAL_TOLERANCE}
        flag, _ = self._model.setup(H, g, A, upper, lower)
        self._time_limit = 0.0
        self._shape = A.shape if flag >= 0 else (-1, -1)
        return flag
