"""`solve`, and `make_solver` for a solver that keeps its workspace, by name of the strategy."""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.errors import UnknownNameError
from poise.hqp._active_set import LexicographicSolver
from poise.hqp._problem import HierarchicalProblem
from poise.hqp._solution import Solution, SolveStatus

STRATEGIES = ("direct", "cascade", "weighted")
"""Names that `solve` and `make_solver` take."""


@runtime_checkable
class Solver(Protocol):
    """Interface of every strategy: the workspace persists, and no number raises."""

    time_limit: float | None

    def solve(self, problem: HierarchicalProblem) -> Solution:
        """Solve one problem; the answer owns its arrays."""
        ...

    def prepare(self, problem: HierarchicalProblem) -> None:
        """Allocate the memory for problems of this shape ahead of the first solve."""
        ...

    def run(self, problem: HierarchicalProblem) -> SolveStatus:
        """Solve one problem; the solver keeps the answer until the next call."""
        ...

    @property
    def x(self) -> Float64[np.ndarray, " n"]:
        """The point of the last `run`; zero where there is none."""
        ...

    @property
    def relative_residuals(self) -> Float64[np.ndarray, " p"]:
        """Relative residuals of the levels at that point, see `Solution`."""
        ...

    def report(self) -> Solution:
        """Return the solution of the last `run`; it owns its arrays."""
        ...

    def follow(self, problem: HierarchicalProblem, last: object) -> None:
        """Begin the next solve, of a problem, with the active set of another problem's solver."""
        ...

    def reset(self) -> None:
        """Forget the last solution, so that the next solve starts cold."""
        ...


def make_solver(
    strategy: str = "direct", backend: str | None = None, *, time_limit: float | None = None
) -> Solver:
    """Return a solver that keeps its workspace from call to call.

    Args:
        strategy: one of `STRATEGIES`.
        backend: QP solver of the cascade and weighted strategies.
        time_limit: cap on each solve [s].

    Raises:
        UnknownNameError: no such strategy or backend.
        MissingExtraError: the backend is not installed.
    """
    if strategy == "direct":
        if backend is not None:
            raise UnknownNameError("direct has no backends", got=backend, choices=["None"])
        return LexicographicSolver(time_limit)
    # These import SciPy's optimizers, which take long, and most controllers need neither.
    if strategy == "cascade":
        from poise.hqp._cascade import CascadeSolver

        return CascadeSolver(backend or "daqp", time_limit)
    if strategy == "weighted":
        from poise.hqp._weighted import WeightedSolver

        return WeightedSolver(backend or "daqp", time_limit=time_limit)
    raise UnknownNameError("no such strategy", got=strategy, choices=STRATEGIES)


def solve(
    problem: HierarchicalProblem,
    strategy: str = "direct",
    *,
    backend: str | None = None,
    time_limit: float | None = None,
) -> Solution:
    """Validate a problem and solve it once.

    Args:
        problem: the problem.
        strategy: one of `STRATEGIES`.
        backend: QP solver of the cascade and weighted strategies.
        time_limit: cap on the solve [s].

    Raises:
        ProblemError: the problem cannot be right, see `HierarchicalProblem`.
        UnknownNameError: no such strategy or backend.
        MissingExtraError: the backend is not installed.
    """
    problem.validate()
    return make_solver(strategy, backend, time_limit=time_limit).solve(problem)
