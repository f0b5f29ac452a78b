"""The `direct` strategy: all rows hard in one solve, exact resolution if that fails."""

from collections.abc import Iterator
from time import perf_counter
from typing import Any, cast

import numpy as np
from jaxtyping import Float64
from scipy.linalg import blas

from poise.hqp.hard import HardPoint, HardQP
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
from poise.hqp.soft_levels import SoftLevels, can_give
from poise.hqp.solution import Solution, SolveStatus
from poise.hqp.status import failure, is_sound

_norm: Any = cast("Any", blas).dnrm2  # SciPy's stubs do not know the wrapped routines

PATIENCE = 20
"""Solves for which a level that no longer gives is still solved as one that may."""


class DirectSolver:
    """Solves with all rows hard, exact whenever everything can be met; else level by level.

    Levels of equality rows that must give, as a posture at the bottom of a stack always must, are
    solved one by one over the others (`SoftLevels`), those of the last solve first. What is left,
    conflicts among inequality rows, goes to the exact resolution (`resolve`).

    The workspace persists: a controller keeps one solver and calls `solve` every tick. Nothing
    raises on numbers.

    Args:
        time_limit: cap on a solve [s]; None for none.
    """

    name = "direct"

    def __init__(self, time_limit: float | None = None) -> None:
        self.time_limit = time_limit
        self._hard = HardQP()
        self._soft_levels = SoftLevels()
        self._soft: tuple[int, ...] = ()
        self._idle = 0
        self._hint: tuple[Stage, ...] = ()
        self._scratch = _Scratch(0, 0)

    def reset(self) -> None:
        """Forget the last solution, so that the next solve starts cold."""
        self._hard.reset()
        self._soft_levels.reset()
        self._soft = ()
        self._idle = 0
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
        # The way that worked at the last tick comes first.
        if not self._soft:
            solution = self._solve_hard(problem, start)
            if solution is not None:
                return solution
        for soft in self._candidates(problem):
            solution = self._solve_soft(problem, soft, start)
            if solution is not None:
                return solution
        self._soft = ()
        solved = perf_counter()
        if not is_sound(problem):
            return failure(problem, SolveStatus.BAD_PROBLEM, self.name, start)
        return self._resolve(problem, start, solved)

    def _solve_hard(self, problem: HierarchicalProblem, start: float) -> Solution | None:
        """Meet every row at once, if that is possible."""
        points = self._hard.candidates(
            problem.H, problem.g, problem.A, problem.lower, problem.upper, self.time_limit or 0.0
        )
        for point in points:
            solution = self._accept(problem, point, start, perf_counter())
            if solution is not None:
                return solution
        return None

    def _candidates(self, problem: HierarchicalProblem) -> Iterator[tuple[int, ...]]:
        """Which levels to let give: those of the last solve, the last alone, or all that can."""
        levels = range(len(problem.levels))
        known = tuple(i for i in self._soft if i in levels and can_give(problem, i))
        if known:
            yield known
        able = tuple(i for i in levels if can_give(problem, i))
        yield from (soft for soft in dict.fromkeys((able[-1:], able)) if soft and soft != known)

    def _solve_soft(
        self, problem: HierarchicalProblem, soft: tuple[int, ...], start: float
    ) -> Solution | None:
        """Meet every level but the soft ones, whose slack is least in their order, if possible."""
        found = self._soft_levels.solve(problem, soft, self.time_limit or 0.0)
        if found is None:
            return None
        x, iterations = found
        solved = perf_counter()
        pair = self._measure(problem, x)
        if not self._is_met(problem, x, pair[0], soft):
            return None
        residuals, scales = self._scratch.norms(problem, pair)
        relative = residuals / scales
        self._remember(soft, relative)
        end = perf_counter()
        return Solution(
            status=SolveStatus.OPTIMAL,
            x=x,
            slacks=pair[0],
            residuals=residuals,
            relative_residuals=relative,
            strategy=self.name,
            relaxed=bool((relative > FEASIBILITY_TOLERANCE).any()),
            iterations=iterations,
            timings={"soft": solved - start, "check": end - solved, "total": end - start},
        )

    def _remember(self, soft: tuple[int, ...], relative: Float64[np.ndarray, " p"]) -> None:
        """Keep the levels that gave for the next solve, and let go of those that no longer do."""
        giving = tuple(i for i in soft if relative[i] > FEASIBILITY_TOLERANCE)
        # A conflict that ended may return at the next tick: letting go costs more than keeping.
        self._idle = self._idle + 1 if len(giving) < len(soft) else 0
        if self._idle > PATIENCE:
            self._soft, self._idle = giving, 0
        else:
            self._soft = soft

    def _measure(
        self, problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, "2 nm"]:
        """Signed slacks at x, and at zero, which is what levels are relative to."""
        points, clipped = self._scratch.points, self._scratch.clipped
        points[0, : problem.n] = x
        np.dot(problem.A, x, out=self._scratch.row_values)
        np.minimum(points, problem.upper, out=clipped)
        np.maximum(clipped, problem.lower, out=clipped)
        return points - clipped

    def _is_met(
        self,
        problem: HierarchicalProblem,
        x: Float64[np.ndarray, " n"],
        slacks: Float64[np.ndarray, " nm"],
        soft: tuple[int, ...] = (),
    ) -> bool:
        """Whether all bounds and rows but the soft levels' hold."""
        # Never below the largest slack, and quicker to get.
        if _norm(slacks) <= FEASIBILITY_TOLERANCE:
            return True
        sizes = np.abs(slacks, out=self._scratch.sizes)
        for level in soft:
            rows = problem.levels[level].slice
            sizes[problem.n + rows.start : problem.n + rows.stop] *= 0.0
        # NaN fails both comparisons and is sorted out on the slow path.
        return bool(
            sizes.max() <= FEASIBILITY_TOLERANCE
            or (sizes <= FEASIBILITY_TOLERANCE * row_sizes(problem, x)).all()
        )

    def _accept(
        self, problem: HierarchicalProblem, point: HardPoint, start: float, solved: float
    ) -> Solution | None:
        """Check a hard point against the problem's rows; None if one does not hold."""
        x = point.x
        pair = self._measure(problem, x)
        if not self._is_met(problem, x, pair[0]):
            return None
        residuals, scales = self._scratch.norms(problem, pair)
        end = perf_counter()
        return Solution(
            status=SolveStatus.OPTIMAL,
            x=x,
            slacks=pair[0],
            residuals=residuals,
            relative_residuals=residuals / scales,
            multipliers=point.multipliers,
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
        self.points = np.zeros((2, n + m))
        self.row_values = self.points[0, n:]
        self.clipped = np.zeros((2, n + m))
        self.sizes = np.zeros(n + m)

    def norms(
        self, problem: HierarchicalProblem, pair: Float64[np.ndarray, "2 nm"]
    ) -> tuple[Float64[np.ndarray, " p"], Float64[np.ndarray, " p"]]:
        """Return every level's residual and scale, both from one product."""
        squares = np.multiply(pair, problem.weights, out=self.clipped)
        squares *= squares
        both = np.sqrt(np.dot(squares, problem.membership))
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
