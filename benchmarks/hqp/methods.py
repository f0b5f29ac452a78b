"""What is raced: names of methods, which of them are installed, and a contestant of each."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import daqp
import numpy as np
from jaxtyping import Float64, Int32

from poise.errors import MissingExtraError, UnknownNameError
from poise.hqp import (
    HierarchicalProblem,
    LexicographicSolver,
    Solution,
    SolveStatus,
    make_solver,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Answer of a method."""

    x: Float64[np.ndarray, " n"]  # its point
    status: str  # how its solve ended, in its own words
    claimed: bool  # whether it says that this is the answer


@runtime_checkable
class Contestant(Protocol):
    """A method with a workspace. Only `solve` is timed."""

    def forget(self) -> None:
        """Forgets the last solve, so that the next one starts cold."""
        ...

    def take(self, problem: HierarchicalProblem) -> None:
        """Takes the next problem, and states it the way the method's own user would write it."""
        ...

    def solve(self) -> None:
        """Solves it, as a user pays for it."""
        ...

    def answer(self) -> Answer:
        """What the last solve found; owns its numbers."""
        ...


class DirectContestant:
    """`LexicographicSolver.run`, the call of a loop.

    Args:
        time_limit: cap on a solve [s].
    """

    def __init__(self, time_limit: float) -> None:
        self._solver = LexicographicSolver(time_limit)
        self._status = SolveStatus.FAILED

    def forget(self) -> None:
        """Forgets the last active set."""
        self._solver.reset()

    def take(self, problem: HierarchicalProblem) -> None:
        """Takes the problem as it is."""
        self._problem = problem

    def solve(self) -> None:
        """Solves it; the answer stays in the workspace."""
        self._status = self._solver.run(self._problem)

    def answer(self) -> Answer:
        """Copies the answer out of the workspace."""
        return Answer(x=self._solver.x.copy(), status=self._status.value, claimed=self._status.ok)


class StrategyContestant:
    """Any strategy, by its `solve`, which makes a `Solution`.

    Args:
        strategy: its name.
        backend: QP solver of the strategy; its own when None.
        time_limit: cap on a solve [s].
    """

    def __init__(self, strategy: str, backend: str | None, time_limit: float) -> None:
        self._solver = make_solver(strategy, backend, time_limit=time_limit)

    def forget(self) -> None:
        """Forgets the last solution."""
        self._solver.reset()

    def take(self, problem: HierarchicalProblem) -> None:
        """Takes the problem as it is."""
        self._problem = problem

    def solve(self) -> None:
        """Solves it."""
        self._solution: Solution = self._solver.solve(self._problem)

    def answer(self) -> Answer:
        """The solution's point and status."""
        found = self._solution
        return Answer(x=found.x, status=found.status.value, claimed=found.ok)


@dataclass(frozen=True, slots=True, kw_only=True)
class DaqpRows:
    """Rows in the order of their levels, simple bounds among those of their level.

    Where bounds are more numerous than rows of `A`, DAQP takes the first as simple bounds on x.
    """

    H: Float64[np.ndarray, "n n"]  # final cost
    g: Float64[np.ndarray, " n"]  # linear final cost
    A: Float64[np.ndarray, "m n"]  # coefficients
    lower: Float64[np.ndarray, " k"]  # lower bounds
    upper: Float64[np.ndarray, " k"]  # upper bounds
    weights: Float64[np.ndarray, " k"]  # of the slacks
    # Where each level begins, and where the last one ends: DAQP's `break_points`
    ends: Int32[np.ndarray, " p1"]


def daqp_rows(problem: HierarchicalProblem) -> DaqpRows:
    """States a problem for DAQP.

    A row of zeros has nothing to say about x, but with bounds that zero does not meet DAQP calls
    the whole problem infeasible, so such rows lose their bounds. Bounds that belong to the first
    level stay simple bounds; others become rows.
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


REFERENCE = "direct"
"""What every other method is compared with."""

_OWN = ("direct", "daqp-hard", "daqp-hierarchical", "weighted")

_BACKENDS = ("daqp", "proxqp", "quadprog", "piqp", "clarabel", "osqp")
"""QP solvers of Poise's cascade and weighted strategies."""

METHODS = (
    *_OWN,
    *(f"cascade/{backend}" for backend in _BACKENDS),
    "direct/solve",
    "daqp-hierarchical/own-scale",
    *(f"weighted/{backend}" for backend in _BACKENDS),
)
"""All names: what is raced by default, then what must be asked for."""

_USUAL = (*_OWN, *(f"cascade/{backend}" for backend in _BACKENDS))

QUICK = ("direct", "daqp-hard", "daqp-hierarchical")
"""Methods, or what stands before their slash, that take turns problem by problem."""


def is_quick(method: str) -> bool:
    """True for a method that takes turns with the quick ones, which leave it a warm cache."""
    return method.partition("/")[0] in QUICK


def usual_methods() -> tuple[str, ...]:
    """What is raced where nothing else is asked for: as far as it is installed."""
    return tuple(name for name in _USUAL if _missing(name) is None)


def what_is_missing() -> tuple[str, ...]:
    """For each usual method that is not installed, what it needs and the command to install it."""
    reasons = (_missing(name) for name in _USUAL)
    return tuple(str(reason) for reason in reasons if reason is not None)


def checked_methods(names: Sequence[str] | None) -> tuple[str, ...]:
    """Everything that is raced: what was asked for, the reference before it."""
    wanted = usual_methods() if names is None else tuple(names)
    for name in wanted:
        if name not in METHODS:
            raise UnknownNameError("unknown method", got=name, choices=METHODS)
        reason = _missing(name)
        if reason is not None:
            raise reason
    return tuple(dict.fromkeys((REFERENCE, *wanted)))


def make_contestant(method: str, time_limit: float) -> Contestant:
    """A method with a workspace of its own; whatever must be compiled is, before it returns.

    Args:
        method: one of `METHODS`.
        time_limit: cap on a solve [s].
    """
    if method == REFERENCE:
        return DirectContestant(time_limit)
    if method == "direct/solve":
        return StrategyContestant("direct", None, time_limit)
    if method == "daqp-hard":
        return DaqpHard(time_limit)
    if method.startswith("daqp-hierarchical"):
        return DaqpHierarchical(time_limit, weighs=method == "daqp-hierarchical")
    strategy, _, backend = method.partition("/")
    return StrategyContestant(strategy, backend or None, time_limit)


def _missing(method: str) -> MissingExtraError | None:
    """The error that a method which is not installed would raise."""
    _, _, backend = method.partition("/")
    if backend not in _BACKENDS:
        return None
    try:
        make_solver("cascade", backend)
    except MissingExtraError as reason:
        return reason
    return None
