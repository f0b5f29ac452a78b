"""QP backends of the cascade and weighted strategies: DAQP itself, all others by qpsolvers.

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
from jaxtyping import Float64

from poise.errors import MissingExtraError, UnknownNameError
from poise.hqp._tolerances import ACCURACY


@dataclass(frozen=True, slots=True)
class QP:
    """One convex QP."""

    P: Float64[np.ndarray, "d d"]
    q: Float64[np.ndarray, " d"]
    A: Float64[np.ndarray, "k d"]
    lower: Float64[np.ndarray, " k"]
    upper: Float64[np.ndarray, " k"]


@runtime_checkable
class Backend(Protocol):
    """A QP solver."""

    def __call__(self, qp: QP, time_limit: float) -> Float64[np.ndarray, " d"] | None:
        """Return the point that the solver calls solved, or None; unchecked."""
        ...


def make_backend(name: str) -> Backend:
    """Return a QP solver.

    Raises:
        UnknownNameError: no such backend.
        MissingExtraError: the backend is not installed.
    """
    if name not in ACCURACY:
        raise UnknownNameError("no such QP backend", got=name, choices=ACCURACY)
    if name == "daqp":
        return solve_by_daqp
    for package in ("proxsuite" if name == "proxqp" else name, "qpsolvers"):
        if find_spec(package) is None:
            raise MissingExtraError(package, "solvers", f"the QP backend {name!r}")
    return QpsolversBackend(name)


def solve_by_daqp(qp: QP, time_limit: float) -> Float64[np.ndarray, " d"] | None:
    """Solve by DAQP, dense dual active set, from a cold start."""
    model: Any = daqp.Model()
    model.settings = {
        "primal_tol": 1e-12,
        "eps_prox": 1e-6,
        "time_limit": 0.0 if time_limit == np.inf else max(time_limit, 1e-6),
    }
    flag, _ = model.setup(qp.P, qp.q, qp.A, qp.upper, qp.lower)
    if flag < 0:
        return None
    x, _, flag, _ = model.solve()
    return x.copy() if flag >= 1 else None


class QpsolversBackend:
    """Any other solver, through qpsolvers, from a cold start.

    Args:
        name: of the solver.
    """

    SETTINGS: ClassVar[dict[str, dict[str, float]]] = {
        "osqp": {"eps_abs": 1e-6, "eps_rel": 1e-6, "max_iter": 20000, "polishing": False},
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

    def __call__(self, qp: QP, time_limit: float) -> Float64[np.ndarray, " d"] | None:
        """Split two-sided rows into equalities and one-sided ones, and solve."""
        if len(qp.lower) == 0:
            # qpsolvers would hand such a problem to an iterative solver.
            return -np.linalg.lstsq(qp.P, qp.q, rcond=1e-12)[0]
        settings = dict(self.SETTINGS[self._name])
        if self._name == "osqp" and time_limit < np.inf:
            # The others have no name for it: there the cap holds between levels.
            settings["time_limit"] = max(time_limit, 1e-6)
        try:
            with warnings.catch_warnings():
                # "Almost solved" is said by `found`; nothing is printed in a control loop.
                warnings.simplefilter("ignore")
                found = self._qpsolvers.solve_problem(
                    self._state(qp), solver=self._name, **settings
                )
        except self._qpsolvers.exceptions.QPError:
            return None
        return np.array(found.x) if found.found and found.x is not None else None

    def _state(self, qp: QP) -> Any:
        """Return the problem as qpsolvers knows it, sparse where the solver is."""
        sparse = self._name in ("clarabel", "osqp", "piqp")
        wrap: Callable[[Any], Any] = scipy.sparse.csc_matrix if sparse else np.asarray
        equality = qp.lower == qp.upper
        above = np.isfinite(qp.upper) & ~equality
        below = np.isfinite(qp.lower) & ~equality
        G = np.vstack([qp.A[above], -qp.A[below]])
        h = np.concatenate([qp.upper[above], -qp.lower[below]])
        return self._qpsolvers.Problem(
            wrap(qp.P),
            qp.q,
            wrap(G) if len(h) else None,
            h if len(h) else None,
            wrap(qp.A[equality]) if equality.any() else None,
            qp.lower[equality] if equality.any() else None,
        )
