"""QP backends of the strategies cascade and weighted: DAQP itself, all others by qpsolvers.

    min x^T P x / 2 + q^T x   s.t.   lower <= A x <= upper

Every solve starts cold. DAQP and quadprog need a definite P, which few of these QPs have: they take
proximal steps, which draw the point to the last one and not to zero, as a ridge would.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import daqp
import numpy as np
import scipy.sparse
from jaxtyping import Float64

from poise.errors import MissingExtraError, UnknownNameError
from poise.hqp._tolerances import (
    ACCURACY,
    COARSE,
    DEFINITE,
    FACTOR_TOLERANCE,
    OPTIMALITY_TOLERANCE,
    POINT_TOLERANCE,
    PROXIMAL_RATIOS,
    SLACK_TOLERANCE,
)


@dataclass(frozen=True, slots=True)
class QP:
    """One convex QP."""

    P: Float64[np.ndarray, "d d"]
    q: Float64[np.ndarray, " d"]
    A: Float64[np.ndarray, "k d"]
    lower: Float64[np.ndarray, " k"]
    upper: Float64[np.ndarray, " k"]
    slope: float = 0.0  # gradient that may remain where the cost is nearly flat


Backend = Callable[[QP, float], Float64[np.ndarray, " d"] | None]
"""QP and time limit [s] to the point that the solver calls solved, unchecked, or None."""

_Solve = Callable[[QP], Float64[np.ndarray, " d"] | None]

SETTINGS: dict[str, dict[str, float]] = {
    "osqp": {"eps_abs": 1e-6, "eps_rel": 1e-6, "max_iter": 20000, "polishing": False},
    "proxqp": {"eps_abs": 1e-11, "eps_rel": 0.0},
    "piqp": {"eps_abs": 1e-11, "eps_rel": 1e-12},
    "clarabel": dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas", "tol_ktratio"), 1e-12),
}
"""Of the solvers behind qpsolvers."""


def make_backend(name: str) -> Backend:
    """Return a QP solver."""
    if name not in ACCURACY:
        raise UnknownNameError("no such QP backend", got=name, choices=ACCURACY)
    if name == "daqp":
        return _solve_by_daqp
    for package in ("proxsuite" if name == "proxqp" else name, "qpsolvers"):
        if find_spec(package) is None:
            raise MissingExtraError(package, "solvers", f"the QP backend {name!r}")
    return partial(_solve_by_qpsolvers, name)


def _solve_by_daqp(qp: QP, time_limit: float) -> Float64[np.ndarray, " d"] | None:
    cap = 0.0 if time_limit == np.inf else max(time_limit, 1e-6)
    settings = {"primal_tol": 1e-12, "eps_prox": 0.0, "time_limit": cap}

    def solve(qp: QP) -> Float64[np.ndarray, " d"] | None:
        model: Any = daqp.Model()
        model.settings = settings
        flag, _ = model.setup(qp.P, qp.q, qp.A, qp.upper, qp.lower)
        if flag < 0:
            return None
        x, _, flag, _ = model.solve()
        return x.copy() if flag >= 1 else None

    return _proximal_point(qp, solve)


def _solve_by_qpsolvers(name: str, qp: QP, time_limit: float) -> Float64[np.ndarray, " d"] | None:
    if len(qp.lower) == 0:
        # qpsolvers would pass such a problem to an iterative solver.
        return -np.linalg.lstsq(qp.P, qp.q, rcond=SLACK_TOLERANCE)[0]
    settings = dict(SETTINGS.get(name, {}))
    if name == "osqp" and time_limit < np.inf:
        # The others have no such setting: their cap holds between levels.
        settings["time_limit"] = max(time_limit, 1e-6)
    qpsolvers: Any = import_module("qpsolvers")
    wrap: Any = scipy.sparse.csc_matrix if name in ("clarabel", "osqp", "piqp") else np.asarray

    def solve(qp: QP) -> Float64[np.ndarray, " d"] | None:
        equality = qp.lower == qp.upper
        above = np.isfinite(qp.upper) & ~equality
        below = np.isfinite(qp.lower) & ~equality
        h = np.concatenate([qp.upper[above], -qp.lower[below]])
        problem = qpsolvers.Problem(
            wrap(qp.P),
            qp.q,
            wrap(np.vstack([qp.A[above], -qp.A[below]])) if len(h) else None,
            h if len(h) else None,
            wrap(qp.A[equality]) if equality.any() else None,
            qp.lower[equality] if equality.any() else None,
        )
        try:
            with warnings.catch_warnings():
                # `found` covers "almost solved"; a control loop prints nothing.
                warnings.simplefilter("ignore")
                solution = qpsolvers.solve_problem(problem, solver=name, **settings)
        except qpsolvers.exceptions.QPError:
            return None
        return np.array(solution.x) if solution.found and solution.x is not None else None

    return _proximal_point(qp, solve) if name == "quadprog" else solve(qp)


def _proximal_point(qp: QP, solve: _Solve) -> Float64[np.ndarray, " d"] | None:
    """Solve a semidefinite QP by a solver for definite ones, with weights in turn."""
    curvatures = np.linalg.eigvalsh(qp.P)
    if curvatures[0] > DEFINITE * curvatures[-1]:
        return solve(qp)
    best: Float64[np.ndarray, " d"] | None = None
    norms = np.linalg.norm(qp.A, axis=1)
    for ratio in PROXIMAL_RATIOS:
        x = _repeat(qp, ratio * max(1e-300, float(np.abs(qp.P).max())), solve)
        if x is None:
            continue
        best, values = x, qp.A @ x
        room = FACTOR_TOLERANCE * np.maximum(1.0, norms * float(np.linalg.norm(x)))
        if (np.maximum(values - qp.upper, qp.lower - values) <= room).all():
            break
    return best


def _repeat(
    qp: QP, weight: float, solve: _Solve, most: int = 300
) -> Float64[np.ndarray, " d"] | None:
    """Minimise the cost plus `weight |x - x_last|^2 / 2` until x converges, or return None."""
    definite = replace(qp, P=qp.P + weight * np.eye(len(qp.q)))
    x, step, size = np.zeros(len(qp.q)), np.inf, 1.0
    for k in range(most):
        found = solve(replace(definite, q=qp.q - weight * x))
        if found is None:
            return None
        last, step = step, float(np.abs(found - x).max(initial=0.0))
        x, size = found, max(1.0, float(np.abs(found).max(initial=0.0)))
        # Small steps that no longer shrink are rounding, magnified by the weak curvature.
        if step <= POINT_TOLERANCE * size or (step <= OPTIMALITY_TOLERANCE * size and step >= last):
            break
        # The gradient of the QP at x is the weight times the step; two or three steps are usual.
        if k >= 10 and weight * step <= qp.slope:
            return x
    return x if step <= COARSE * size else None
