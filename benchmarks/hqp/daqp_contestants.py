"""DAQP on its own: all levels hard in one QP, and its hierarchical mode."""

from typing import Any

import daqp
import numpy as np
from jaxtyping import Float64, Int32

from benchmarks.hqp.contestant import Answer
from benchmarks.hqp.daqp_rows import DaqpRows, daqp_rows
from poise.hqp import HierarchicalProblem

PRIMAL_TOLERANCE = 1e-10
"""On rows, in DAQP's units; its default of 1e-6 would miss `LEVEL_TOLERANCE` by itself."""

SOFTNESS = 1e-6
"""DAQP's default: the share of the final cost in each level's problem. With 1e-8 and less it is
right less often."""

_FLAGS = {
    3: "stopped short",
    2: "soft optimal",
    1: "optimal",
    -1: "infeasible",
    -2: "cycling",
    -3: "unbounded",
    -4: "iteration limit",
    -5: "not convex",
    -6: "overdetermined",
    -7: "time limit",
    -8: "unsupported",
}
"""What DAQP's exit flags mean; those above zero call the answer good."""


class _DaqpContestant:
    """What both have in common: a model that persists.

    Args:
        time_limit: cap on a solve [s].
    """

    def __init__(self, time_limit: float) -> None:
        self._time_limit = time_limit
        self.forget()

    def forget(self) -> None:
        """Begins with a new model."""
        self._model: Any = daqp.Model()
        self._model.settings = {
            "primal_tol": PRIMAL_TOLERANCE,
            "rho_soft": SOFTNESS,
            "time_limit": self._time_limit,
        }
        self._shape: tuple[int, ...] = ()
        self._x: Float64[np.ndarray, " n"] = np.zeros(0)
        self._flag = -8

    def take(self, problem: HierarchicalProblem) -> None:
        """States the problem for DAQP."""
        self._rows: DaqpRows = daqp_rows(problem)

    def answer(self) -> Answer:
        """Copies the point out of DAQP's own buffer."""
        status = _FLAGS.get(self._flag, f"exit flag {self._flag}")
        if len(self._x) != len(self._rows.g):
            return Answer(x=np.zeros(len(self._rows.g)), status=status, claimed=False)
        return Answer(x=self._x.copy(), status=status, claimed=self._flag >= 1)

    def _load(self, ends: Int32[np.ndarray, " p1"] | None) -> bool:
        """Gives the model its numbers, anew where the shape is another; whether it takes them."""
        rows, model = self._rows, self._model
        shape = (*rows.A.shape, *rows.ends.tolist())
        if shape == self._shape:
            # DAQP looks at the first coefficient of what it is given, even where there is none.
            A = rows.A if len(rows.A) else None
            self._flag = model.update(rows.H, rows.g, A, rows.upper, rows.lower)
        else:
            data = (rows.H, rows.g, rows.A, rows.upper, rows.lower)
            self._flag, _ = model.setup(*data, None, ends)
        self._shape = shape if self._flag >= 0 else ()
        return self._flag >= 0


class DaqpHard(_DaqpContestant):
    """One QP with the rows of all levels hard: exact where everything can be met, else infeasible.

    Args:
        time_limit: cap on a solve [s].
    """

    def solve(self) -> None:
        """Sets up or updates the model, and solves it."""
        if self._load(None):
            self._x, _, self._flag, _ = self._model.solve()


class DaqpHierarchical(_DaqpContestant):
    """DAQP's hierarchical mode.

    It minimises `|u|^2 / 2 + |s|^2 / (2 rho)` level by level, `u = R x + R^-T g` with
    `H = R^T R`, so the final cost has a small share in every level. By itself it measures the slack
    `s` of a row relative to `|a R^-1|`, which loses the user's weights; weights of soft rows give
    them back.

    Args:
        time_limit: cap on a solve [s].
        weighs: whether rows are given the user's weights.
    """

    def __init__(self, time_limit: float, *, weighs: bool) -> None:
        super().__init__(time_limit)
        self._weighs = weighs

    def take(self, problem: HierarchicalProblem) -> None:
        """States the problem for DAQP, with weights of slacks as it takes them."""
        super().take(problem)
        self._softness = SOFTNESS / self._rows.weights**2

    def solve(self) -> None:
        """Sets up or updates the model, and solves it."""
        if not self._load(self._rows.ends):
            return
        if self._weighs and len(self._softness):
            self._model.soft_weights(self._softness, self._softness, None, None)
        self._x, _, self._flag, _ = self._model.solve()
