"""QP backends of the cascade and weighted strategies: one adapter each, loaded when asked for.

min x^T P x / 2 + q^T x   s.t.   lower <= A x <= upper
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, ClassVar, Protocol, runtime_checkable

import daqp
import numpy as np
import scipy.sparse
from jaxtyping import Bool, Float64

from poise.errors import MissingExtraError, UnknownNameError


@dataclass(frozen=True, slots=True)
class QP:
    """One convex QP, with the pattern of entries that may ever be other than zero.

    A sparse backend keeps its set-up as long as patterns stay, so they are said once and not read
    off the numbers, where a coefficient that happens to be zero would drop out.
    """

    P: Float64[np.ndarray, "d d"]
    q: Float64[np.ndarray, " d"]
    A: Float64[np.ndarray, "k d"]
    lower: Float64[np.ndarray, " k"]
    upper: Float64[np.ndarray, " k"]
    P_pattern: Bool[np.ndarray, "d d"]
    A_pattern: Bool[np.ndarray, "k d"]
    definite: bool = False


@runtime_checkable
class Backend(Protocol):
    """A QP solver with a workspace for problems of one pattern."""

    def solve(self, qp: QP, time_limit: float) -> Float64[np.ndarray, " d"] | None:
        """Return the point that the solver calls solved, or None; unchecked."""
        ...


PROXIMAL_WEIGHTS = (1e-7, 1e-5, 1e-3)
"""Curvatures added, relative to P's largest entry, for backends that factor a singular P: the
smallest converges fastest, a larger one is tried where the backend finds no point with it."""

PROXIMAL_STEPS = 300
"""Most repetitions; two or three are usual, more where a level barely curves a direction."""

PROXIMAL_TOLERANCE = 1e-11
"""The repetition ends when a step is this small, relative to the point."""


PROXIMAL_NOISE = 1e-8
"""Steps this small that no longer shrink are rounding, magnified by the weak curvature."""

PROXIMAL_FEASIBILITY = 1e-10
"""Rows violated by more than this, relative to their size, call for a larger curvature: a small one
magnifies the backend's own tolerance."""

PROXIMAL_FAILURE = 1e-6
"""A last step larger than this says that the repetitions did not converge."""


def proximal_point(
    qp: QP,
    solve: Callable[
        [Float64[np.ndarray, "d d"], Float64[np.ndarray, " d"]], Float64[np.ndarray, " d"] | None
    ],
) -> Float64[np.ndarray, " d"] | None:
    """Solve a semidefinite QP exactly with a solver for definite ones.

    Each repetition adds `weight |x - x_last|^2 / 2`, which vanishes where they converge: unlike a
    ridge it pulls towards the last point and not towards zero, so it swallows nothing.

    Args:
        qp: the problem.
        solve: solves with the Hessian and gradient it is given, and the problem's rows.
    """
    if qp.definite:
        return solve(qp.P, qp.q)
    best: Float64[np.ndarray, " d"] | None = None
    for share in PROXIMAL_WEIGHTS:
        weight = share * max(1e-300, float(np.abs(qp.P).max()))
        point = _repeat(qp.P + weight * np.eye(len(qp.q)), qp.q, weight, solve)
        if point is not None:
            best = point
            if _meets_rows(qp, point):
                break
    return best


def _meets_rows(qp: QP, x: Float64[np.ndarray, " d"]) -> bool:
    values = qp.A @ x
    sizes = np.maximum(1.0, np.linalg.norm(qp.A, axis=1) * float(np.linalg.norm(x)))
    violation = np.maximum(values - qp.upper, qp.lower - values)
    return bool((violation <= PROXIMAL_FEASIBILITY * sizes).all())


def _repeat(
    curved: Float64[np.ndarray, "d d"],
    q: Float64[np.ndarray, " d"],
    weight: float,
    solve: Callable[
        [Float64[np.ndarray, "d d"], Float64[np.ndarray, " d"]], Float64[np.ndarray, " d"] | None
    ],
) -> Float64[np.ndarray, " d"] | None:
    """Repeat proximal steps of one weight until they converge; None if they do not."""
    x, step, size = np.zeros(len(q)), np.inf, 1.0
    for _ in range(PROXIMAL_STEPS):
        found = solve(curved, q - weight * x)
        if found is None:
            return None
        last, step = step, float(np.abs(found - x).max(initial=0.0))
        x = found
        size = max(1.0, float(np.abs(x).max(initial=0.0)))
        if step <= PROXIMAL_TOLERANCE * size or (step <= PROXIMAL_NOISE * size and step >= last):
            break
    return x if step <= PROXIMAL_FAILURE * size else None


class DaqpBackend:
    """DAQP, dense dual active set, warm-started through the proximal repetitions."""

    def solve(self, qp: QP, time_limit: float) -> Float64[np.ndarray, " d"] | None:
        """Solve from a cold start: the active set of another problem is no guess."""
        model: Any = None
        known: Any = None

        def repeat(
            P: Float64[np.ndarray, "d d"], q: Float64[np.ndarray, " d"]
        ) -> Float64[np.ndarray, " d"] | None:
            nonlocal model, known
            if P is not known:
                known = P
                model = daqp.Model()
                model.settings = {
                    "primal_tol": 1e-12,
                    "eps_prox": 0.0,
                    "time_limit": 0.0 if time_limit == np.inf else max(time_limit, 1e-6),
                }
                flag, _ = model.setup(P, q, qp.A, qp.upper, qp.lower)
            else:
                flag = model.update(f=q)
            if flag < 0:
                return None
            x, _, flag, _ = model.solve()
            return x.copy() if flag >= 1 else None

        return proximal_point(qp, repeat)


class OsqpBackend:
    """OSQP, sparse ADMM: set up once per pattern, then updated and warm-started."""

    SETTINGS: ClassVar[dict[str, float | bool | int]] = {
        "eps_abs": 1e-6,
        "eps_rel": 1e-6,
        "max_iter": 20000,
        "polishing": False,
        "verbose": False,
    }

    def __init__(self) -> None:
        self._osqp = import_module("osqp")
        self._solver: Any = None
        self._patterns: tuple[bytes, bytes] = (b"", b"")

    def solve(self, qp: QP, time_limit: float) -> Float64[np.ndarray, " d"] | None:
        """Update the numbers where the pattern is the last one, else set up anew."""
        limit = 1e10 if time_limit == np.inf else max(time_limit, 1e-6)
        P_pattern, A_pattern = np.triu(qp.P_pattern), qp.A_pattern
        patterns = (
            P_pattern.tobytes() + bytes(str(P_pattern.shape), "ascii"),
            A_pattern.tobytes() + bytes(str(A_pattern.shape), "ascii"),
        )
        if self._solver is None or patterns != self._patterns:
            self._solver = self._osqp.OSQP()
            self._patterns = patterns
            self._solver.setup(
                P=_columns(qp.P, P_pattern),
                q=qp.q,
                A=_columns(qp.A, A_pattern),
                l=qp.lower,
                u=qp.upper,
                time_limit=limit,
                **self.SETTINGS,
            )
        else:
            self._solver.update(
                Px=qp.P.T[P_pattern.T],
                Ax=qp.A.T[A_pattern.T],
                q=qp.q,
                l=qp.lower,
                u=qp.upper,
            )
            self._solver.update_settings(time_limit=limit)
        result = self._solver.solve(raise_error=False)
        solved = result.info.status_val == self._osqp.SolverStatus.OSQP_SOLVED
        return np.array(result.x) if solved else None


class QpsolversBackend:
    """Any other solver, through qpsolvers."""

    SETTINGS: ClassVar[dict[str, dict[str, float]]] = {
        "proxqp": {"eps_abs": 1e-11, "eps_rel": 0.0},
        "piqp": {"eps_abs": 1e-11, "eps_rel": 1e-12},
        "clarabel": {
            "tol_gap_abs": 1e-12,
            "tol_gap_rel": 1e-12,
            "tol_feas": 1e-12,
            "tol_ktratio": 1e-12,
        },
        "quadprog": {},
    }

    def __init__(self, name: str) -> None:
        self._name = name
        self._qpsolvers = import_module("qpsolvers")

    def solve(self, qp: QP, time_limit: float) -> Float64[np.ndarray, " d"] | None:
        """Split two-sided rows into equalities and one-sided ones, and solve cold."""
        del time_limit  # qpsolvers has no common name for it: the cap holds between levels
        equality = qp.lower == qp.upper
        above = np.isfinite(qp.upper) & ~equality
        below = np.isfinite(qp.lower) & ~equality
        wrap: Callable[[Any], Any] = (
            scipy.sparse.csc_matrix if self._name in ("clarabel", "piqp") else np.asarray
        )
        if len(qp.lower) == 0:
            # qpsolvers would hand such a problem to an iterative solver.
            return -np.linalg.lstsq(qp.P, qp.q, rcond=1e-12)[0]
        G = np.vstack([qp.A[above], -qp.A[below]])
        h = np.concatenate([qp.upper[above], -qp.lower[below]])

        def once(
            P: Float64[np.ndarray, "d d"], q: Float64[np.ndarray, " d"]
        ) -> Float64[np.ndarray, " d"] | None:
            problem = self._qpsolvers.Problem(
                wrap(P),
                q,
                wrap(G) if len(h) else None,
                h if len(h) else None,
                wrap(qp.A[equality]) if equality.any() else None,
                qp.lower[equality] if equality.any() else None,
            )
            settings = self.SETTINGS[self._name]
            try:
                with warnings.catch_warnings():
                    # "Almost solved" is said by `found`; nothing is printed in a control loop.
                    warnings.simplefilter("ignore")
                    solution = self._qpsolvers.solve_problem(problem, solver=self._name, **settings)
            except self._qpsolvers.exceptions.QPError:
                return None
            return np.array(solution.x) if solution.found and solution.x is not None else None

        if self._name == "quadprog":
            return proximal_point(qp, once)
        return once(qp.P, qp.q)


ACCURACY: dict[str, float] = {
    "daqp": 1e-8,
    "proxqp": 1e-8,
    "quadprog": 1e-6,
    "piqp": 1e-6,
    "clarabel": 1e-6,
    "osqp": 1e-3,
}
"""How far a level's slack, relative to its scale, may have drifted by the end of a cascade before
the answer is called INACCURATE. The one table of tolerances, by backend; the settings that reach
them stand with each adapter."""

_PACKAGES = {"proxqp": "proxsuite"}
"""Import names where they differ from the backend's."""


def make_backend(name: str) -> Callable[[], Backend]:
    """Return a function that makes workspaces of a backend.

    Raises:
        UnknownNameError: no such backend.
        MissingExtraError: the backend is not installed.
    """
    if name not in ACCURACY:
        raise UnknownNameError("no such QP backend", got=name, choices=ACCURACY)
    if name == "daqp":
        return DaqpBackend
    needed = [_PACKAGES.get(name, name)] + ([] if name == "osqp" else ["qpsolvers"])
    for package in needed:
        if find_spec(package) is None:
            raise MissingExtraError(package, "solvers", f"the QP backend {name!r}")
    return OsqpBackend if name == "osqp" else lambda: QpsolversBackend(name)


def is_definite(P: Float64[np.ndarray, "d d"]) -> bool:
    """Return whether P is positive definite by a margin that a factorisation can rely on."""
    values = np.linalg.eigvalsh(P)
    return len(values) > 0 and bool(values[0] > 1e-8 * values[-1])


def _columns(
    matrix: Float64[np.ndarray, "k d"], pattern: Bool[np.ndarray, "k d"]
) -> scipy.sparse.csc_matrix:
    """Return a compressed-column matrix with exactly the pattern's entries, zeros included."""
    pointers = np.concatenate([[0], np.cumsum(pattern.sum(axis=0))])
    rows = np.nonzero(pattern.T)[1]
    return scipy.sparse.csc_matrix((matrix.T[pattern.T], rows, pointers), shape=matrix.shape)
