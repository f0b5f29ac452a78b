"""Exact resolution, level by level, of a problem in which something must give.

Levels that can be met are met together by one hard QP. The first that cannot gets its least slack
exactly; then its equalities, its violated rows and every row with a clear multiplier are fixed at
the values reached, because they have them at every optimum, the space shrinks to what is left, and
the remaining levels are tried hard again.
"""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from jaxtyping import Bool, Float64, Int

from poise.hqp.hard import HardPoint, HardQP
from poise.hqp.least_slack import RANK_TOLERANCE, LeastSlack, Rows, least_slack, predicted_slack
from poise.hqp.measure import FEASIBILITY_TOLERANCE, row_sizes
from poise.hqp.problem import HierarchicalProblem
from poise.hqp.reduction import Reduction


@dataclass(frozen=True, slots=True)
class Stage:
    """The active set of one level that had to give, to be tried first next time.

    Attributes:
        level: the level.
        sides: of every stacked row: 1 at or above its upper bound, -1 at or below its lower
            one, for the level's violated inequalities and the rows that stand in its way.
    """

    level: int
    sides: Int[np.ndarray, " nm"]


@dataclass(frozen=True, slots=True)
class Resolution:
    """What the exact method found.

    Attributes:
        x: the point.
        multipliers: of the final cost over bounds and rows, fixed rows of either sign.
        stages: the levels that had to give, with their active sets.
        iterations: active-set changes and solver iterations.
        complete: whether every level and the final cost were resolved.
        timed_out: whether the deadline came first.
    """

    x: Float64[np.ndarray, " n"]
    multipliers: Float64[np.ndarray, " nm"] | None
    stages: tuple[Stage, ...]
    iterations: int
    complete: bool
    timed_out: bool


def resolve(
    problem: HierarchicalProblem, deadline: float = np.inf, hint: tuple[Stage, ...] = ()
) -> Resolution:
    """Solve a problem lexicographically whose rows cannot, or may not, all be met.

    Args:
        problem: finite coefficients, bounds that do not cross.
        deadline: `perf_counter` time at which to stop with the best point so far [s].
        hint: what the last, similar problem's resolution found. If it still holds, one hard QP
            proves it; if not, nothing but time is lost.
    """
    if hint:
        resolution = _Resolver(problem, deadline).replay(hint)
        if resolution is not None:
            return resolution
    return _Resolver(problem, deadline).run(hint[0].level if hint else None)


class _Resolver:
    def __init__(self, problem: HierarchicalProblem, deadline: float) -> None:
        self.problem = problem
        self.deadline = deadline
        self.space = Reduction(problem)
        self.iterations = 0
        self.stages: list[Stage] = []
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

    def replay(self, hint: tuple[Stage, ...]) -> Resolution | None:
        """Resolve with the active sets of another problem; None if they do not fit this one.

        Each stage's signs are checked as it is solved. That a point exists which meets all held
        rows is left to the hard QP at the end, whose point then proves every stage optimal.
        """
        space, first = self.space, 0
        last = len(self.problem.levels) - 1
        space.trusted = False
        for stage in hint:
            if stage.level > last or len(stage.sides) != len(space.norms):
                return None
            if not self._assume_met(first, stage.level - 1) or not self._predict(stage):
                return None
            first = stage.level + 1
        point = self._try_hard(first, last)
        return None if point is None else self._finish(point, first, last)

    def _assume_met(self, first: int, last: int) -> bool:
        """Solve the equalities of levels and hold their inequalities, met or not so far."""
        space, problem = self.space, self.problem
        indices = space.level_rows(first, last)
        equality = problem.lower[indices] == problem.upper[indices]
        exact = indices[equality]
        if len(exact):
            rows = space.rows(exact)
            y = np.linalg.lstsq(rows.A, rows.lower, rcond=RANK_TOLERANCE)[0]
            space.move(y)
            sizes = row_sizes(problem, space.point)[exact]
            if (np.abs(rows.A @ y - rows.lower) > FEASIBILITY_TOLERANCE * sizes).any():
                return False
        space.hold(indices, equality)
        return True

    def _predict(self, stage: Stage) -> bool:
        """Give a level its slack on the predicted active set; return whether the signs fit."""
        space, problem = self.space, self.problem
        indices = space.level_rows(stage.level, stage.level)
        soft, sizes = self._soft_rows(indices)
        best = predicted_slack(
            soft, space.held_rows(), sizes, stage.sides[indices], stage.sides[space.held]
        )
        if best is None:
            return False
        space.move(best.z)
        equality = problem.lower[indices] == problem.upper[indices]
        violated = (stage.sides[indices] != 0) & ~equality
        slack = np.abs(best.slack) / problem.weights[indices]
        visible = slack > FEASIBILITY_TOLERANCE * row_sizes(problem, space.point)[indices]
        if (violated & ~visible).any():
            return False
        self._record(stage.level, indices, best, visible)
        forced = space.held[best.held != 0]
        space.hold(indices, equality | violated)
        space.fix(forced)
        return True

    def _record(
        self,
        level: int,
        indices: Int[np.ndarray, " k"],
        best: LeastSlack,
        visible: Bool[np.ndarray, " k"],
    ) -> None:
        """Note the active set of a level that had to give."""
        self.iterations += best.iterations
        if visible.any():
            sides = np.zeros(len(self.space.norms), dtype=np.int64)
            sides[indices[visible]] = np.sign(best.slack[visible]).astype(np.int64)
            sides[self.space.held] = best.held
            self.stages.append(Stage(level, sides))

    def _soft_rows(self, indices: Int[np.ndarray, " k"]) -> tuple[Rows, Float64[np.ndarray, " k"]]:
        """Return rows multiplied by their weights, and their sizes before any reduction."""
        weights = self.problem.weights[indices]
        rows = self.space.rows(indices)
        soft = Rows(rows.A * weights[:, None], rows.lower * weights, rows.upper * weights)
        return soft, weights * self.space.norms[indices]

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
        space = self.space
        indices = space.level_rows(level, level)
        soft, sizes = self._soft_rows(indices)
        start = np.zeros(space.freedom)
        best = least_slack(soft, space.held_rows(), start, sizes, self.deadline)
        self._keep(level, best)

    def _keep(self, level: int, best: LeastSlack) -> None:
        space, problem = self.space, self.problem
        indices = space.level_rows(level, level)
        self.converged &= best.converged
        space.move(best.z)
        sizes = row_sizes(problem, space.point)[indices]
        slack = np.abs(best.slack) / problem.weights[indices]
        violated = slack > FEASIBILITY_TOLERANCE * sizes
        self._record(level, indices, best, violated)
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
            stages=tuple(self.stages),
            iterations=self.iterations,
            complete=complete and self.converged,
            timed_out=perf_counter() > self.deadline,
        )

    def _time_left(self) -> float:
        """Seconds until the deadline as DAQP wants them: 0 means no limit."""
        if self.deadline == np.inf:
            return 0.0
        return max(self.deadline - perf_counter(), 1e-6)
