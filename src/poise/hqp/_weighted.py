"""Strategy `weighted`: one QP in which higher levels have larger weights.

    min  sum_i ratio^(p - i) |W w_i|^2 + x^T H x / 2 + g^T x      i = 0 .. p - 1

The lowest levels, of equality rows alone, are terms of the cost, and the rows of all levels above
are hard. Where that has no solution, the lowest of the hard levels is soft, then the lowest two,
and so on; the first level last. A lower level worsens a higher one by about 1/ratio of its own
slack: priorities are approximate.
"""

from collections.abc import Iterator
from time import perf_counter

import numpy as np

from poise.errors import ConfigurationError
from poise.hqp._backends import QP
from poise.hqp._cold import ColdSolver
from poise.hqp._measure import measure_point
from poise.hqp._problem import HierarchicalProblem
from poise.hqp._solution import Solution, SolveStatus, failure
from poise.hqp._tolerances import MET_TOLERANCE


class WeightedSolver(ColdSolver):
    """Solve one QP over x and all slacks.

    Args:
        backend: name of the QP solver.
        ratio: weight of a level relative to the next, more than one.
        time_limit: cap on a solve [s]; None for none.

    Raises:
        ConfigurationError: a ratio or a cap out of range.
    """

    strategy = "weighted"

    def __init__(
        self, backend: str = "daqp", ratio: float = 1e2, time_limit: float | None = None
    ) -> None:
        if not 1.0 < ratio < np.inf:
            raise ConfigurationError("not a ratio of priorities", got=ratio, wanted="1 < ratio")
        super().__init__(backend, time_limit)
        self.ratio = ratio

    def _solve(self, problem: HierarchicalProblem, start: float, deadline: float) -> Solution:
        for qp in _forms(problem, self.ratio):
            point = self._solve_qp(qp, deadline - perf_counter())
            if point is not None and np.isfinite(point).all():
                x = point[: problem.n].copy()
                measure = measure_point(problem, x)
                return Solution(
                    status=SolveStatus.OPTIMAL,
                    x=x,
                    slacks=measure.slacks,
                    residuals=measure.residuals,
                    relative_residuals=measure.relative,
                    strategy=self.name,
                    strict=False,
                    relaxed=bool((measure.relative > MET_TOLERANCE).any()),
                    timings={"total": perf_counter() - start},
                )
            if perf_counter() > deadline:
                return failure(problem, SolveStatus.TIME_LIMIT, self.name, start)
        return failure(problem, SolveStatus.FAILED, self.name, start)


def _forms(problem: HierarchicalProblem, ratio: float) -> Iterator[QP]:
    """Yield QPs of ever more soft levels; the last one always has a solution."""
    first = len(problem.levels)
    while first > 0 and _can_be_cost(problem, first - 1):
        first -= 1
    if first == len(problem.levels):
        yield _scalarised(problem, ratio, 1)
        yield _scalarised(problem, ratio, 0)
    else:
        for soft in range(first, -1, -1):
            yield _tasks_as_cost(problem, ratio, first, soft)


def _tasks_as_cost(
    problem: HierarchicalProblem, ratio: float, first: int, soft: int, span: float = 1e6
) -> QP:
    """Set up the QP with the levels from `first` on in the cost, and slack from `soft` on."""
    count, n = len(problem.levels), problem.n
    # The largest weight is one: DAQP takes rows that a large Hessian shrinks for empty ones.
    # A larger span of weights leaves it no precision.
    ratio = min(ratio, span ** (1.0 / (count - first)))
    unit = ratio ** (first - count)
    hessian, q = unit * problem.H, unit * problem.g
    for i, view in enumerate(problem.levels[first:], start=first):
        weights = ratio ** (first - i) * view.weights**2
        hessian += view.A.T @ (weights[:, None] * view.A)
        q -= view.A.T @ (weights * view.lower)
    rows = np.flatnonzero(np.isfinite(problem.lower) | np.isfinite(problem.upper))
    rows = rows[problem.level_of[rows] < first]
    slack = np.flatnonzero(problem.level_of[rows] >= soft)
    costs = ratio ** (first - problem.level_of[rows[slack]]) * problem.weights[rows[slack]] ** 2
    A = np.zeros((len(rows), n + len(slack)))
    A[:, :n] = np.vstack([np.eye(n), problem.A])[rows]
    # In units in which the square of a slack costs one.
    A[slack, n + np.arange(len(slack))] = -1.0 / np.sqrt(costs)
    P = np.eye(n + len(slack))
    P[:n, :n] = hessian
    return QP(
        P=P,
        q=np.append(q, np.zeros(len(slack))),
        A=A,
        lower=problem.lower[rows],
        upper=problem.upper[rows],
        # An error of 0.01 [unit/s^2] along directions of next to no cost may remain.
        slope=0.01 * unit * ratio,
    )


def _can_be_cost(problem: HierarchicalProblem, level: int) -> bool:
    """Return whether a level has equality rows alone, or none, and lies below the simple bounds."""
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
