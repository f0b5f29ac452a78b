"""All rows hard in one QP, with a workspace that persists and an answer that others check.

min x^T H x / 2 + g^T x   s.t.   lower <= [x; A x] <= upper
"""

from collections.abc import Iterator
from dataclasses import dataclass

import daqp
import numpy as np
from jaxtyping import Float64

from poise.hqp.known_active import BALANCE_TOLERANCE, KnownActive

PRIMAL_TOLERANCE = 1e-10
"""DAQP's tolerance on rows it does not hold, in units of `|a R^-1|` where `H = R^T R`."""


LARGEST_SYSTEM = 128
"""Unknowns and active rows up to which `KnownActive` is tried: OpenBLAS shares larger systems out
among threads, which takes milliseconds where other work holds a core."""


@dataclass(frozen=True, slots=True)
class HardPoint:
    """What one hard solve found: point, multipliers, iterations of the active-set search."""

    x: Float64[np.ndarray, " n"]
    multipliers: Float64[np.ndarray, " nm"]
    iterations: int


class HardQP:
    """QPs of one shape, from call to call: the active rows of the last answer first, then DAQP.

    DAQP keeps the active set of its last solve and the equality flags it was set up with; an
    equality it was not told about it finds itself from equal bounds. So rows are never declared
    as equalities here, and the flags cannot go stale.

    Args:
        refines: whether H's curvatures lie far apart, see `KnownActive`.
    """

    def __init__(self, *, refines: bool = False) -> None:
        self._refines = refines
        self.reset()

    def reset(self) -> None:
        """Forget everything, so that the next solve starts cold."""
        self._model = daqp.Model()
        self._shape = (-1, -1, -1)
        self._found: Float64[np.ndarray, " nm"] | None = None
        self._known: KnownActive | None = None

    def solve(
        self,
        H: Float64[np.ndarray, "n n"],
        g: Float64[np.ndarray, " n"],
        A: Float64[np.ndarray, "m n"],
        lower: Float64[np.ndarray, " nm"],
        upper: Float64[np.ndarray, " nm"],
        time_limit: float = 0.0,
    ) -> HardPoint | None:
        """Return the point DAQP would call optimal, or None if there is none.

        Args:
            H: Hessian.
            g: gradient at zero.
            A: coefficients of the rows.
            lower: lower bounds of the first variables, then of the rows.
            upper: upper bounds likewise.
            time_limit: cap on DAQP [s]; 0 for none.
        """
        self._take(H, A, lower, upper, time_limit)
        return self.again(g)

    def candidates(
        self,
        H: Float64[np.ndarray, "n n"],
        g: Float64[np.ndarray, " n"],
        A: Float64[np.ndarray, "m n"],
        lower: Float64[np.ndarray, " nm"],
        upper: Float64[np.ndarray, " nm"],
        time_limit: float = 0.0,
    ) -> Iterator[HardPoint]:
        """As `solve`, for a caller that checks all rows anyway and asks on if some do not hold.

        Yields:
            The point of the last active rows, then DAQP's, where the forces balance.
        """
        self._take(H, A, lower, upper, time_limit)
        point = self._repeat(g)
        if point is not None:
            yield point
        point = self._search(g)
        if point is not None and _is_balanced(H, g, A, point):
            yield point

    def again(self, g: Float64[np.ndarray, " n"]) -> HardPoint | None:
        """Solve the last QP, which had an answer, with another gradient.

        Args:
            g: gradient at zero.
        """
        point = self._repeat(g)
        if point is not None and self._known is not None and self._known.meets_rows(point.x):
            return point
        return self._search(g)

    def _take(
        self,
        H: Float64[np.ndarray, "n n"],
        A: Float64[np.ndarray, "m n"],
        lower: Float64[np.ndarray, " nm"],
        upper: Float64[np.ndarray, " nm"],
        time_limit: float,
    ) -> None:
        """Make a QP the one to solve; no solver has seen its numbers yet."""
        if self._shape != (*A.shape, len(lower)):
            self.reset()
        self._given = H, A, lower, upper, time_limit
        self._factored = self._loaded = False

    def _repeat(self, g: Float64[np.ndarray, " n"]) -> HardPoint | None:
        """The optimum if the active rows are those of DAQP's last answer."""
        H, A, lower, upper, _ = self._given
        if self._known is None:
            if self._found is None or self._loaded:
                return None
            self._known = KnownActive(
                self._found, len(g), len(lower) - len(A), refines=self._refines
            )
        if self._factored:
            found = self._known.again(g)
        else:
            found = self._known.solve(H, g, A, lower, upper)
            self._factored = True
        return None if found is None else HardPoint(*found, 0)

    def _search(self, g: Float64[np.ndarray, " n"]) -> HardPoint | None:
        """Have DAQP find the active rows, from those of its last answer."""
        H, A, lower, upper, time_limit = self._given
        self._found = self._known = None
        model = self._model
        if self._loaded:
            flag = model.update(None, g)
        elif self._shape == (*A.shape, len(lower)):
            # DAQP indexes the first coefficient of what it is given, even where there is none.
            flag = model.update(H, g, A if len(A) else None, upper, lower)
        else:
            model.settings = {"primal_tol": PRIMAL_TOLERANCE}
            self._time_limit = 0.0
            flag, _ = model.setup(H, g, A, upper, lower)
            if flag >= 0:
                self._shape = (*A.shape, len(lower))
        if flag < 0:
            return None
        self._loaded = True
        if time_limit != self._time_limit:
            self._time_limit = time_limit
            model.settings = {"time_limit": time_limit}
        x, _, flag, info = model.solve()
        if flag < 1:
            return None
        # DAQP answers with its own buffers, which the next solve overwrites.
        found = info["lam"].copy()
        if len(x) + np.count_nonzero(found) <= LARGEST_SYSTEM:
            self._found = found
        return HardPoint(x.copy(), found, info["iterations"])


def _is_balanced(
    H: Float64[np.ndarray, "n n"],
    g: Float64[np.ndarray, " n"],
    A: Float64[np.ndarray, "m n"],
    point: HardPoint,
) -> bool:
    """Whether the forces at a point balance, so that it is stationary."""
    bounds = len(point.multipliers) - len(A)
    curvature, pull = H @ point.x, point.multipliers[bounds:] @ A
    size = max(float(np.abs(force).max()) for force in (curvature, pull, g))
    rest = curvature + pull + g
    rest[:bounds] += point.multipliers[:bounds]
    return float(np.abs(rest).max()) <= BALANCE_TOLERANCE * max(size, 1.0)
