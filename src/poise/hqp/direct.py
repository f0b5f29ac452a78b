"""The `direct` strategy: all rows hard in one solve, exact resolution if that fails."""

from time import perf_counter

import numpy as np
from jaxtyping import Float64

from poise.hqp.hard import STATIONARITY_TOLERANCE, HardPoint, HardQP
from poise.hqp.last_level import LastLevelQP
from poise.hqp.lexicographic import Resolution, Stage, resolve
from poise.hqp.measure import (
    FEASIBILITY_TOLERANCE,
    level_norms,
    level_scales,
    row_sizes,
    row_values,
    signed_slacks,
)
from poise.hqp.problem import HierarchicalProblem
from poise.hqp.solution import Solution, SolveStatus
from poise.hqp.status import failure, is_sound


class DirectSolver:
    """Solves with all rows hard, exact whenever everything can be met; else level by level.

    Where only the last level must give, as a posture at the bottom of a stack always must, that
    level is the cost of one QP over the others (`LastLevelQP`), which the next solve tries first.

    The workspace persists: a controller keeps one solver and calls `solve` every tick. Nothing
    raises on numbers.

    Args:
        time_limit: cap on a solve [s]; None for none.
    """

    name = "direct"

    def __init__(self, time_limit: float | None = None) -> None:
        self.time_limit = time_limit
        self._hard = HardQP()
        self._last_level = LastLevelQP()
        self._last_gives = False
        self._hint: tuple[Stage, ...] = ()
        self._scratch = _Scratch(0, 0)

    def reset(self) -> None:
        """Forget the last solution, so that the next solve starts cold."""
        self._hard.reset()
        self._last_level.reset()
        self._last_gives = False
        self._hint = ()

    def solve(self, problem: HierarchicalProblem) -> Solution:
        """Solve one problem; the answer owns its arrays.

        Args:
            problem: of any shape; a new shape sets the workspace up anew.
        """
        start = perf_counter()
        scratch = self._scratch
        if scratch.shape != problem.A.shape:
            self._scratch = _Scratch(problem.n, problem.m)
        attempts = (self._solve_hard, self._solve_last_level)
        # Two looks at the same numbers: the way that worked at the last tick comes first.
        for attempt in attempts[::-1] if self._last_gives else attempts:
            solution = attempt(problem, start)
            if solution is not None:
                return solution
        solved = perf_counter()
        if not is_sound(problem):
            return failure(problem, SolveStatus.BAD_PROBLEM, self.name, start)
        return self._resolve(problem, start, solved)

    def _solve_hard(self, problem: HierarchicalProblem, start: float) -> Solution | None:
        """Meet every row at once, if that is possible."""
        point = self._hard.solve(
            problem.H, problem.g, problem.A, problem.lower, problem.upper, self.time_limit or 0.0
        )
        if point is None:
            return None
        solution = self._accept(problem, point, start, perf_counter())
        self._last_gives = solution is None
        return solution

    def _solve_last_level(self, problem: HierarchicalProblem, start: float) -> Solution | None:
        """Meet every level but the last, whose slack is least, if that is possible."""
        found = self._last_level.solve(problem, self.time_limit or 0.0)
        if found is None:
            self._last_gives = False
            return None
        x, iterations = found
        solved = perf_counter()
        slacks = self._measure(problem, x)
        hard = problem.n + problem.m - len(problem.levels[-1].lower)
        if not self._is_met(problem, x, hard):
            return None
        residuals, scales = self._scratch.norms(problem)
        relative = residuals / scales
        # Where the last level is met after all, the next solve meets everything at once.
        self._last_gives = bool(relative[-1] > FEASIBILITY_TOLERANCE)
        end = perf_counter()
        return Solution(
            status=SolveStatus.OPTIMAL,
            x=x,
            slacks=slacks.copy(),
            residuals=residuals,
            relative_residuals=relative,
            strategy=self.name,
            relaxed=self._last_gives,
            iterations=iterations,
            timings={"last_level": solved - start, "check": end - solved, "total": end - start},
        )

    def _measure(
        self, problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " nm"]:
        """Fill the scratch with row values and signed slacks, and return the slacks."""
        scratch, n = self._scratch, problem.n
        values, slacks = scratch.values, scratch.slacks
        values[:n] = x
        np.dot(problem.A, x, out=values[n:])
        np.minimum(values, problem.upper, out=scratch.clipped)
        np.maximum(scratch.clipped, problem.lower, out=scratch.clipped)
        np.subtract(values, scratch.clipped, out=slacks)
        return slacks

    def _is_met(
        self, problem: HierarchicalProblem, x: Float64[np.ndarray, " n"], count: int
    ) -> bool:
        """Whether the first bounds and rows hold, going by the measured slacks."""
        sizes = np.abs(self._scratch.slacks[:count], out=self._scratch.sizes[:count])
        # NaN fails both comparisons and is sorted out on the slow path.
        return bool(
            sizes.max(initial=0.0) <= FEASIBILITY_TOLERANCE
            or (sizes <= FEASIBILITY_TOLERANCE * row_sizes(problem, x)[:count]).all()
        )

    def _accept(
        self, problem: HierarchicalProblem, point: HardPoint, start: float, solved: float
    ) -> Solution | None:
        """Check a hard point against the problem's numbers; None if it does not hold."""
        scratch = self._scratch
        n, x, multipliers = problem.n, point.x, point.multipliers
        slacks = self._measure(problem, x)
        if not self._is_met(problem, x, n + problem.m):
            return None
        curvature = np.dot(problem.H, x, out=scratch.curvature)
        pull = np.dot(multipliers[n:], problem.A, out=scratch.pull)
        size = max(np.abs(curvature).max(), np.abs(pull).max(), np.abs(problem.g).max(), 1.0)
        curvature += pull
        curvature += problem.g
        curvature += multipliers[:n]
        if not np.abs(curvature, out=curvature).max() <= STATIONARITY_TOLERANCE * size:
            return None
        residuals, scales = scratch.norms(problem)
        end = perf_counter()
        return Solution(
            status=SolveStatus.OPTIMAL,
            x=x,
            slacks=slacks.copy(),
            residuals=residuals,
            relative_residuals=residuals / scales,
            multipliers=multipliers,
            strategy="direct",
            iterations=point.iterations,
            timings={"hard": solved - start, "check": end - solved, "total": end - start},
        )

    def _resolve(self, problem: HierarchicalProblem, start: float, solved: float) -> Solution:
        """Resolve level by level what could not be met at once."""
        # A point that DAQP got wrong must not start the next tick.
        self._hard.reset()
        deadline = np.inf if self.time_limit is None else start + self.time_limit
        resolution = resolve(problem, deadline, self._hint)
        self._hint = resolution.stages
        return _report(problem, resolution, start, solved)


class _Scratch:
    """Buffers of the hot path, so that it allocates only what it gives away."""

    def __init__(self, n: int, m: int) -> None:
        self.shape = (m, n)
        self.values = np.zeros(n + m)
        self.clipped = np.zeros(n + m)
        self.slacks = np.zeros(n + m)
        self.sizes = np.zeros(n + m)
        self.curvature = np.zeros(n)
        self.pull = np.zeros(n)
        self.pair = np.zeros((2, n + m))

    def norms(
        self, problem: HierarchicalProblem
    ) -> tuple[Float64[np.ndarray, " p"], Float64[np.ndarray, " p"]]:
        """Return every level's residual and scale, both from one product."""
        pair = self.pair
        pair[0] = self.slacks
        np.maximum(problem.lower, 0.0, out=pair[1])
        pair[1] += np.minimum(problem.upper, 0.0)
        pair *= problem.weights
        pair *= pair
        both = np.sqrt(np.dot(pair, problem.membership))
        return both[0], np.maximum(both[1], 1.0)


def _report(
    problem: HierarchicalProblem, resolution: Resolution, start: float, solved: float
) -> Solution:
    if not np.isfinite(resolution.x).all():
        return failure(problem, SolveStatus.FAILED, "direct", start)
    slacks = signed_slacks(problem, row_values(problem, resolution.x))
    residuals = level_norms(problem, slacks)
    if resolution.complete:
        status = SolveStatus.OPTIMAL
    else:
        status = SolveStatus.TIME_LIMIT if resolution.timed_out else SolveStatus.INACCURATE
    end = perf_counter()
    return Solution(
        status=status,
        x=resolution.x,
        slacks=slacks,
        residuals=residuals,
        relative_residuals=residuals / level_scales(problem),
        multipliers=resolution.multipliers,
        strategy="direct",
        relaxed=bool(resolution.stages),
        iterations=resolution.iterations,
        timings={"hard": solved - start, "levels": end - solved, "total": end - start},
    )
