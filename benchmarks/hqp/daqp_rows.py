"""`DaqpRows`: a hierarchical problem as DAQP takes it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from poise.hqp import HierarchicalProblem


@dataclass(frozen=True, slots=True, kw_only=True)
class DaqpRows:
    """Rows in the order of their levels, simple bounds among those of their level.

    Where bounds are more numerous than rows of `A`, DAQP takes the first as simple bounds on x.

    Attributes:
        H: final cost.
        g: linear final cost.
        A: coefficients.
        lower: lower bounds.
        upper: upper bounds.
        weights: of the slacks.
        ends: where each level begins, and where the last one ends: DAQP's `break_points`.
    """

    H: Float64[np.ndarray, "n n"]
    g: Float64[np.ndarray, " n"]
    A: Float64[np.ndarray, "m n"]
    lower: Float64[np.ndarray, " k"]
    upper: Float64[np.ndarray, " k"]
    weights: Float64[np.ndarray, " k"]
    ends: Int32[np.ndarray, " p1"]


def daqp_rows(problem: HierarchicalProblem) -> DaqpRows:
    """States a problem for DAQP.

    A row of zeros has nothing to say about x, but with bounds that zero does not meet DAQP calls
    the whole problem infeasible, so such rows lose their bounds. Bounds that belong to the first
    level stay simple bounds; others become rows.

    Args:
        problem: the problem.
    """
    A, lower, upper, weights = problem.A, problem.lower, problem.upper, problem.weights
    ends = [0, *(problem.n + view.slice.stop for view in problem.levels)]
    if problem.bounds_level > 0:
        order = _order_with_bounds(problem)
        A = np.vstack([np.eye(problem.n), A])[order]
        lower, upper, weights = lower[order], upper[order], weights[order]
        ends = [0, *np.cumsum(np.bincount(problem.level_of[order], minlength=len(ends) - 1))]
    empty = np.flatnonzero(~A.any(axis=1)) + len(lower) - len(A)
    if len(empty):
        lower, upper = lower.copy(), upper.copy()
        lower[empty], upper[empty] = -np.inf, np.inf
    return DaqpRows(
        H=problem.H,
        g=problem.g,
        A=A,
        lower=lower,
        upper=upper,
        weights=weights,
        ends=np.array(ends, dtype=np.int32),
    )


def _order_with_bounds(problem: HierarchicalProblem) -> np.ndarray:
    """Bounds and rows by level, without bounds that are none."""
    bounded = np.isfinite(problem.lower) | np.isfinite(problem.upper)
    bounded[problem.n :] = True
    kept = np.flatnonzero(bounded)
    return kept[np.argsort(problem.level_of[kept], kind="stable")]
