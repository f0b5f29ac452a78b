"""The `weighted` strategy: one QP in which a higher level is merely dearer, as a last resort.

    min  sum_i ratio^(p - i) |W w_i|^2 + x^T H x / 2 + g^T x      i = 0 .. p - 1

On a robot the lowest levels, of equality rows alone, are terms of the cost, and all above is hard.
Where that has no solution, the lowest of the hard levels is soft, then the lowest two, and so on;
the first level last. A lower level worsens a higher one by about 1/ratio of its own slack:
priorities are kept only approximately.
"""

from collections.abc import Iterator
from time import perf_counter

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_time_limit
from poise.errors import ConfigurationError
from poise.hqp._backends import QP, make_backend
from poise.hqp._faults import is_sound
from poise.hqp._measure import measure_point
from poise.hqp._problem import HierarchicalProblem
from poise.hqp._solution import KeepsSolution, Solution, SolveStatus, failure
from poise.hqp._tolerances import LEFT_OVER, MET_TOLERANCE, WEIGHT_SPAN


class WeightedSolver(KeepsSolution):
    """Solves one QP over x and all slacks."""

    def __init__(
        self, backend: str = "daqp", ratio: float = 1e2, time_limit: float | None = None
    ) -> None:
        if not 1.0 < ratio < np.inf:
            raise ConfigurationError("not a ratio of priorities", got=ratio, wanted="1 < ratio")
        self.backend, self.ratio = backend, ratio
        self.time_limit = checked_time_limit(time_limit)
        self.name = f"weighted/{backend}"
        self._solve_qp = make_backend(backend)

    def reset(self) -> None:
        """Do nothing: every solve starts cold."""

    def solve(self, problem: HierarchicalProblem) -> Solution:
        """Solve one problem; the answer owns its arrays."""
        start = perf_counter()
        if not is_sound(problem):
            return failure(problem, SolveStatus.BAD_PROBLEM, self.name, start)
        deadline = np.inf if self.time_limit is None else start + self.time_limit
        for qp in _forms(problem, self.ratio):
            point = self._solve_qp(qp, deadline - perf_counter())
            if point is not None and np.isfinite(point).all():
                return self._report(problem, point[: problem.n], start)
            if perf_counter() > deadline:
                return failure(problem, SolveStatus.TIME_LIMIT, self.name, start)
        return failure(problem, SolveStatus.FAILED, self.name, start)

    def _report(
        self, problem: HierarchicalProblem, x: Float64[np.ndarray, " n"], start: float
    ) -> Solution:
        measure = measure_point(problem, x)
        return Solution(
            status=SolveStatus.OPTIMAL,
            x=x.copy(),
            slacks=measure.slacks,
            residuals=measure.residuals,
            relative_residuals=measure.relative,
            strategy=self.name,
            strict=False,
            relaxed=bool((measure.relative > MET_TOLERANCE).any()),
            timings={"total": perf_counter() - start},
        )


def _forms(problem: HierarchicalProblem, ratio: float) -> Iterator[QP]:
    """The QPs to try, the hardest first; the last one always has a solution."""
    first = len(problem.levels)
    while first > 0 and _can_be_cost(problem, first - 1):
        first -= 1
    if first == len(problem.levels):
        yield _scalarised(problem, ratio, 1)
        yield _scalarised(problem, ratio, 0)
    else:
        for soft in range(first, -1, -1):
            yield _tasks_as_cost(problem, ratio, first, soft)


def _tasks_as_cost(problem: HierarchicalProblem, ratio: float, first: int, soft: int) -> QP:
    """The usual form on a robot: the lowest levels are terms of the cost, and need no slack."""
    count, n = len(problem.levels), problem.n
    # The dearest task weighs one: DAQP takes rows that a large Hessian shrinks for empty ones.
    ratio = min(ratio, WEIGHT_SPAN ** (1.0 / (count - first)))
    unit = ratio ** (first - count)
    hessian, q = unit * problem.H, unit * problem.g
    for i, view in enumerate(problem.levels[first:], start=first):
        weights = ratio ** (first - i) * view.weights**2
        hessian += view.A.T @ (weights[:, None] * view.A)
        q -= view.A.T @ (weights * view.lower)
    rows = np.flatnonzero(np.isfinite(problem.lower) | np.isfinite(problem.upper))
    rows = rows[problem.level_of[rows] < first]
    slack = np.flatnonzero(problem.level_of[rows] >= soft)
    dearness = ratio ** (first - problem.level_of[rows[slack]]) * problem.weights[rows[slack]] ** 2
    A = np.zeros((len(rows), n + len(slack)))
    A[:, :n] = np.vstack([np.eye(n), problem.A])[rows]
    # Each slack is measured so that its square costs one.
    A[slack, n + np.arange(len(slack))] = -1.0 / np.sqrt(dearness)
    P = np.eye(n + len(slack))
    P[:n, :n] = hessian
    return QP(
        P=P,
        q=np.append(q, np.zeros(len(slack))),
        A=A,
        lower=problem.lower[rows],
        upper=problem.upper[rows],
        slope=LEFT_OVER * unit * ratio,
    )


def _can_be_cost(problem: HierarchicalProblem, level: int) -> bool:
    """Whether a level can be a term of the cost: equality rows alone, below the simple bounds.

    An empty level is one, too: above it others may be.
    """
    view = problem.levels[level]
    return level > problem.bounds_level and bool((view.lower == view.upper).all())


def _scalarised(problem: HierarchicalProblem, ratio: float, first_soft: int) -> QP:
    """Set up the QP in (x, w), with a slack for each bounded row of the levels that are soft."""
    bounded = np.isfinite(problem.lower) | np.isfinite(problem.upper)
    rows = np.flatnonzero(bounded)
    soft = problem.level_of[rows] >= first_soft
    n, k, s = problem.n, len(rows), int(soft.sum())
    A = np.zeros((k, n + s))
    A[:, :n] = np.vstack([np.eye(n), problem.A])[rows]
    A[np.flatnonzero(soft), n + np.arange(s)] = -1.0
    priority = len(problem.levels) - problem.level_of[rows[soft]]
    P = np.zeros((n + s, n + s))
    P[:n, :n] = problem.H
    slack = np.arange(n, n + s)
    P[slack, slack] = 2.0 * ratio**priority * problem.weights[rows[soft]] ** 2
    return QP(
        P=P,
        q=np.concatenate([problem.g, np.zeros(s)]),
        A=A,
        lower=problem.lower[rows],
        upper=problem.upper[rows],
    )
