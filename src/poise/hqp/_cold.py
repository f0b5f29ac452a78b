"""`ColdSolver`: base of the strategies that solve QPs by a backend, each from a cold start."""

from time import perf_counter
from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_time_limit
from poise.hqp._backends import make_backend
from poise.hqp._problem import HierarchicalProblem, faults
from poise.hqp._solution import Solution, SolveStatus, failure


class ColdSolver:
    """Solver without a workspace: `run` keeps the `Solution` that `solve` returns.

    Args:
        backend: name of the QP solver.
        time_limit: cap on a solve [s]; None for none.
    """

    strategy: ClassVar[str]

    def __init__(self, backend: str = "daqp", time_limit: float | None = None) -> None:
        self.backend, self.name = backend, f"{self.strategy}/{backend}"
        self.time_limit = checked_time_limit(time_limit)
        self._solve_qp = make_backend(backend)
        self._kept: Solution | None = None

    def solve(self, problem: HierarchicalProblem) -> Solution:
        """Solve one problem; the answer owns its arrays."""
        start = perf_counter()
        if faults(problem):
            return failure(problem, SolveStatus.BAD_PROBLEM, self.name, start)
        deadline = np.inf if self.time_limit is None else start + self.time_limit
        return self._solve(problem, start, deadline)

    def _solve(self, problem: HierarchicalProblem, start: float, deadline: float) -> Solution:
        raise NotImplementedError

    def prepare(self, problem: HierarchicalProblem) -> None:
        """Do nothing: each solve allocates its own memory."""

    def follow(self, problem: HierarchicalProblem, last: object) -> None:
        """Do nothing: every solve starts cold."""

    def reset(self) -> None:
        """Do nothing: every solve starts cold."""

    def run(self, problem: HierarchicalProblem) -> SolveStatus:
        """Solve one problem and keep the answer."""
        self._kept = self.solve(problem)
        return self._kept.status

    def report(self) -> Solution:
        """Return the solution of the last `run`."""
        assert self._kept is not None, "no run yet"
        return self._kept

    @property
    def x(self) -> Float64[np.ndarray, " n"]:
        """The point of the last `run`; empty before."""
        return np.zeros(0) if self._kept is None else self._kept.x

    @property
    def relative_residuals(self) -> Float64[np.ndarray, " p"]:
        """Relative residuals of the levels there, see `Solution`; empty before."""
        return np.zeros(0) if self._kept is None else self._kept.relative_residuals
