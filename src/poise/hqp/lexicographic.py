"""Exact resolution, level by level, of a problem in which something must give.

Levels that can be met are met together by one hard QP. The first that cannot gets its least slack
exactly; then its equalities, its violated rows and every row with a clear multiplier are fixed at
the values reached, because they have them at every optimum, the space shrinks to what is left, and
the remaining levels are tried hard again.
"""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from jaxtyping import Float64

from poise.hqp.hard import HardPoint, HardQP
from poise.hqp.least_slack import LeastSlack, Rows, least_slack
from poise.hqp.measure import FEASIBILITY_TOLERANCE, row_sizes
from poise.hqp.problem import HierarchicalProblem
from poise.hqp.reduction import Reduction


@dataclass(frozen=True, slots=True)
class Resolution:
    """What the exact method found.

    Attributes:
        x: the point.
        multipliers: of the final cost over bounds and rows, fixed rows of either sign.
        conflicts: the levels that had to give.
        iterations: active-set changes and solver iterations.
        complete: whether every level and the final cost were resolved.
        timed_out: whether the deadline came first.
    """

    x: Float64[np.ndarray, " n"]
    multipliers: Float64[np.ndarray, " nm"] | None
    conflicts: tuple[int, ...]
    iterations: int
    complete: bool
    timed_out: bool


def resolve(
    problem: HierarchicalProblem, deadline: float = np.inf, hint: int | None = None
) -> Resolution:
    """Solve a problem lexicographically whose rows cannot, or may not, all be met.

    Args:
        problem: finite coefficients, bounds that do not cross.
        deadline: `perf_counter` time at which to stop with the best point so far [s].
        hint: the level expected to be the first that cannot be met.
    """
    return _Resolver(problem, deadline).run(hint)


class _Resolver:
    def __init__(self, problem: HierarchicalProblem, deadline: float) -> None:
        self.problem = problem
        self.deadline = deadline
        self.space = Reduction(problem)
        self.iterations = 0
        self.conflicts: list[int] = []
        self.converged = True
        # Scaled so that DAQP's tolerances mean the same whatever the cost's unit.
        self.unit = float(np.trace(problem.H)) / problem.n or 1.0

    def run(self, hint: int | None) -> Resolution:
        """Resolve level after level."""
        last = len(self.problem.levels) - 1
        first = 0
        if hint is not None and 0 < hint <= last and self._meet(0, hint - 1):
            first = hint
        fresh = True  # all levels at once is known to fail at first
        while first <= last:
            if perf_counter() > self.deadline:
                return self._result(None, complete=False)
            if not fresh:
                point = self._try_hard(first, last)
                if point is not None:
                    return self._finish(point, first, last)
            fresh = False
            first = self._advance(first, last)
        return self._final_cost()

    def _advance(self, first: int, last: int) -> int:
        """Meet levels until one must give, resolve that one, and return the next."""
        for level in range(first, last + 1):
            if perf_counter() > self.deadline:
                return level
            if level < last and self._meet(level, level):
                continue
            self._relax(level)
            return level + 1
        return last + 1

    def _meet(self, first: int, last: int) -> bool:
        """Meet levels exactly if that is possible, and hold them; return whether it was."""
        point = self._try_hard(first, last)
        if point is None:
            return False
        self.space.move(point.x)
        rows = self.space.level_rows(first, last)
        self.space.hold(rows, self.problem.lower[rows] == self.problem.upper[rows])
        return True

    def _try_hard(self, first: int, last: int) -> HardPoint | None:
        """Minimise the final cost with everything held and levels `first` to `last` hard."""
        space, problem = self.space, self.problem
        indices = space.level_rows(first, last)
        held, rows = space.held_rows(), space.rows(indices)
        A = np.vstack([held.A, rows.A])
        lower = np.concatenate([held.lower, rows.lower])
        upper = np.concatenate([held.upper, rows.upper])
        y = np.zeros(space.freedom)
        point: HardPoint | None = HardPoint(y, np.zeros(len(lower)), 0)
        if space.freedom > 0:
            H = space.basis.T @ problem.H @ space.basis / self.unit
            g = space.basis.T @ (problem.H @ space.point + problem.g) / self.unit
            point = HardQP().solve(H, g, A, lower, upper, self._time_left())
        if point is None or not np.isfinite(point.x).all():
            return None
        self.iterations += point.iterations
        values = A @ point.x
        violation = np.maximum(lower - values, values - upper)
        every = np.concatenate([space.held, indices])
        sizes = row_sizes(problem, space.point + space.basis @ point.x)[every]
        if (violation > FEASIBILITY_TOLERANCE * sizes).any():
            return None
        return point

    def _relax(self, level: int) -> None:
        """Give `level` its least slack, and hold what was reached."""
        space, problem = self.space, self.problem
        indices = space.level_rows(level, level)
        weights = problem.weights[indices]
        plain = space.rows(indices)
        soft = Rows(plain.A * weights[:, None], plain.lower * weights, plain.upper * weights)
        sizes = weights * space.norms[indices]
        start = np.zeros(space.freedom)
        best = least_slack(soft, space.held_rows(), start, sizes, self.deadline)
        self._keep(level, best)

    def _keep(self, level: int, best: LeastSlack) -> None:
        space, problem = self.space, self.problem
        indices = space.level_rows(level, level)
        self.iterations += best.iterations
        self.converged &= best.converged
        space.move(best.z)
        sizes = row_sizes(problem, space.point)[indices]
        slack = np.abs(best.slack) / problem.weights[indices]
        violated = slack > FEASIBILITY_TOLERANCE * sizes
        if violated.any():
            self.conflicts.append(level)
        equality = problem.lower[indices] == problem.upper[indices]
        forced = space.held[best.held != 0]
        space.hold(indices, equality | violated)
        if violated.any():
            space.fix(forced)

    def _finish(self, point: HardPoint, first: int, last: int) -> Resolution:
        """Take a point that meets all remaining levels hard."""
        space, problem = self.space, self.problem
        indices = np.concatenate([space.held, space.level_rows(first, last)])
        multipliers = np.zeros(problem.n + problem.m)
        multipliers[indices] = point.multipliers * self.unit
        space.move(point.x)
        return self._result(multipliers, complete=True)

    def _final_cost(self) -> Resolution:
        """Minimise the final cost with every level resolved."""
        last = len(self.problem.levels) - 1
        point = self._try_hard(last + 1, last)
        if point is not None:
            return self._finish(point, last + 1, last)
        # What is left may be too thin for DAQP. The cost is a least-squares level too, and the
        # point at hand meets everything held.
        space, problem = self.space, self.problem
        H = space.basis.T @ problem.H @ space.basis
        g = space.basis.T @ (problem.H @ space.point + problem.g)
        values, vectors = np.linalg.eigh(H)
        keep = values > 1e-12 * max(float(values.max(initial=0.0)), 1e-300)
        root = np.sqrt(values[keep])
        target = -(vectors[:, keep].T @ g) / root
        A = root[:, None] * vectors[:, keep].T
        best = least_slack(
            Rows(A, target, target),
            space.held_rows(),
            np.zeros(space.freedom),
            root,
            self.deadline,
        )
        self.iterations += best.iterations
        self.converged &= best.converged
        space.move(best.z)
        return self._result(None, complete=best.converged)

    def _result(
        self, multipliers: Float64[np.ndarray, " nm"] | None, *, complete: bool
    ) -> Resolution:
        space, problem = self.space, self.problem
        if multipliers is not None and space.fixed.any():
            gradient = problem.H @ space.point + problem.g + space.coefficients.T @ multipliers
            normals = space.coefficients[space.fixed]
            multipliers[space.fixed] = -np.linalg.lstsq(normals.T, gradient, rcond=1e-12)[0]
        return Resolution(
            x=space.point,
            multipliers=multipliers,
            conflicts=tuple(self.conflicts),
            iterations=self.iterations,
            complete=complete and self.converged,
            timed_out=perf_counter() > self.deadline,
        )

    def _time_left(self) -> float:
        """Seconds until the deadline as DAQP wants them: 0 means no limit."""
        if self.deadline == np.inf:
            return 0.0
        return max(self.deadline - perf_counter(), 1e-6)
