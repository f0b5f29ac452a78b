"""`SoftenedSolver`: levels softened towards a reference where they cannot be met."""

from collections.abc import Callable, Mapping, Sequence
from time import perf_counter

import numpy as np
from jaxtyping import Float64

from poise.hqp._measure import Measure, measure_point
from poise.hqp._problem import HierarchicalProblem
from poise.hqp._solution import Solution, SolveStatus
from poise.hqp._strategies import Solver
from poise.hqp._tolerances import MET_TOLERANCE

_USABLE = (SolveStatus.OPTIMAL, SolveStatus.INACCURATE)


class SoftenedLevel:
    """The problem down to one level, with the rows of the reference in that level."""

    def __init__(
        self,
        problem: HierarchicalProblem,
        key: int,
        level: int,
        columns: Sequence[int],
        solver: Solver,
    ) -> None:
        self.key, self.solver = key, solver
        self.rows = problem.levels[level].slice
        above = problem.levels[: level + 1]
        sizes = [view.slice.stop - view.slice.start for view in above]
        sizes[-1] += len(columns)
        self.problem = HierarchicalProblem.allocate(
            problem.n, sizes, [view.name for view in above], bounds_level=problem.bounds_level
        )
        labels, left = list[tuple[str, int]](), problem.n + self.rows.stop
        for name, count in problem.labels:
            labels.append((name, min(count, left)))
            left -= labels[-1][1]
        self.problem.labels[:] = [*labels, ("reference", len(columns))]
        own, rows = self.problem, self.rows.stop
        own.A[rows + np.arange(len(columns)), columns] = 1.0
        self._copies = [
            (own.A[:rows], problem.A[:rows]),
            (own.H, problem.H),
            (own.g, problem.g),
            *(
                (mine[: problem.n + rows], numbers[: problem.n + rows])
                for mine, numbers in (
                    (own.lower, problem.lower),
                    (own.upper, problem.upper),
                    (own.weights, problem.weights),
                )
            ),
        ]
        self._bounds = own.lower[problem.n + rows :], own.upper[problem.n + rows :]
        self._weights = own.weights[problem.n + rows :]
        solver.prepare(self.problem)

    def fill(self, weight: float, reference: Float64[np.ndarray, " j"]) -> None:
        """Copy the rows down to the level, and set weight and target of the reference's rows."""
        for own, given in self._copies:
            np.copyto(own, given)
        self._bounds[0][:] = self._bounds[1][:] = reference
        self._weights[:] = weight


class SoftenedSolver:
    """Solve hierarchies in which levels that cannot be met are softened.

    A softened level k of weight mu_k > 0 is decided by

        x_k = argmin |W_k (A_k x - b_k)|^2 + mu_k^2 |x_J - d|^2    subject to the levels above,

    and the levels below keep `A_k x = A_k x_k`, not x_k: the null space of its rows stays theirs.
    So a level comes to rest where it cannot be met (Tikhonov regularisation), and the levels below
    cost it nothing, for x_k does not depend on them. The reference costs it no more than

        |W_k (A_k x_k - b_k)|^2 <= r_k^2 + mu_k^2 |x_J - d|^2

    with r_k its residual without softening and x any point that reaches it. Where
    `mu_k |x_J - d|` is at most `tolerance` the level is strict: a tick in which everything can be
    met takes one solve, and its answer is that of the problem without softening.

    Args:
        problem: the hierarchy; its numbers may change, its arrays may not.
        solver: solver of the whole problem.
        levels: softened levels, highest first, by the key that `follow` matches them by.
        columns: variables of the reference.
        weights: mu of each of these levels, 0 for none.
        reference: value of those variables.
        find: sets the reference and returns the largest weight times the distance from a point.
        exact: whether the last of these levels decides the whole answer.
        tolerance: weighted distance from the reference below which a level is strict.
        make_solver: makes the solver of a level.
    """

    def __init__(
        self,
        problem: HierarchicalProblem,
        solver: Solver,
        levels: Mapping[int, int],
        columns: Sequence[int],
        *,
        weights: Float64[np.ndarray, " s"],
        reference: Float64[np.ndarray, " j"],
        find: Callable[[Float64[np.ndarray, " n"]], float],
        exact: bool,
        tolerance: float,
        make_solver: Callable[[], Solver],
    ) -> None:
        self._problem, self._solver, self._tolerance = problem, solver, tolerance
        self._weights, self._reference, self._find = weights, reference, find
        self._stages = [
            SoftenedLevel(problem, key, level, columns, make_solver())
            for key, level in levels.items()
        ]
        self._exact = exact
        # mu of each level at the last solve, 0 where it was strict
        self.softened: Float64[np.ndarray, " s"] = np.zeros(len(levels))
        self._soft = [False] * len(levels)
        self._any_soft = False
        self._measure: Measure | None = None
        self._status, self._seconds = SolveStatus.FAILED, 0.0
        solver.prepare(problem)

    @property
    def x(self) -> Float64[np.ndarray, " n"]:
        """The answer of the last `run`."""
        return self._solver.x if self._measure is None else self._x

    @property
    def relative_residuals(self) -> Float64[np.ndarray, " p"]:
        """Residuals of the problem's levels by their scales, as the problem was set."""
        if self._measure is None:
            return self._solver.relative_residuals
        return self._measure.relative

    def run(self) -> SolveStatus:
        """Solve the problem as it is; the answer stays here until the next call."""
        solver, strict = self._solver, None
        if not self._any_soft:
            strict = status = solver.run(self._problem)
            if status not in _USABLE or self._find(solver.x) <= self._tolerance:
                if self._measure is not None:
                    self._measure, self.softened[:] = None, 0.0
                return status
        else:
            self._find(solver.x)
        return self._run(strict)

    def soften(self) -> SolveStatus:
        """Soften the answer that the solver of the whole problem holds, and begin all else cold."""
        self._forget_stages()
        return self._run(SolveStatus.OPTIMAL)

    def reset(self) -> None:
        """Forget the last solutions."""
        self._solver.reset()
        self._forget_stages()

    def _forget_stages(self) -> None:
        for k, stage in enumerate(self._stages):
            stage.solver.reset()
            self._soft[k] = False
        self._any_soft, self._measure, self.softened[:] = False, None, 0.0

    def _run(self, strict: SolveStatus | None) -> SolveStatus:
        begin = perf_counter()
        self._status = self._solve(strict)
        self._seconds = perf_counter() - begin
        return self._status

    def follow(self, last: "SoftenedSolver") -> None:
        """Begin the next solve where that of another problem ended, such as of other contacts."""
        self._solver.follow(self._problem, last._solver)
        others = {stage.key: k for k, stage in enumerate(last._stages)}
        for k, stage in enumerate(self._stages):
            other = others.get(stage.key)
            if other is not None:
                stage.solver.follow(stage.problem, last._stages[other].solver)
            self._soft[k] = other is not None and last._soft[other]
        self._any_soft = any(self._soft)

    def report(self) -> Solution:
        """Return the solution of the last `run`; it owns its arrays."""
        if self._measure is None:
            return self._solver.report()
        slacks, residuals, _ = self._measure
        relative = self._measure.relative.copy()
        return Solution(
            status=self._status,
            x=self.x.copy(),
            slacks=slacks.copy(),
            residuals=residuals.copy(),
            relative_residuals=relative,
            strategy="softened",
            relaxed=bool(relative.max() > MET_TOLERANCE),
            timings={"total": self._seconds},
        )

    def _solve(self, strict: SolveStatus | None) -> SolveStatus:
        """Soften the levels of the last solve, then those that strain, the lowest first."""
        weights = self._weights.tolist()
        soft = [was and mu > 0.0 for was, mu in zip(self._soft, weights, strict=True)]
        while True:
            if any(soft):
                status, x = self._solve_softened(soft)
            else:
                status = strict or self._solver.run(self._problem)
                x = self._solver.x
            if status not in _USABLE:
                # Without an answer of the softened levels, strict ones may have one.
                soft = self._soft = [False] * len(soft)
                status, x = self._solver.run(self._problem), self._solver.x
                break
            strain = self._strain(x)
            more = [
                k
                for k, is_soft in enumerate(soft)
                if not is_soft and not weights[k] * strain <= self._tolerance
            ]
            if not more:
                break
            soft[more[-1]] = True
        self._x, self._measure = x, measure_point(self._problem, x)
        self.softened[:] = np.where(soft, self._weights, 0.0)
        self._any_soft = any(self._soft)
        return status

    def _solve_softened(self, soft: list[bool]) -> tuple[SolveStatus, Float64[np.ndarray, " n"]]:
        """Solve with some levels softened, highest first, and hold the rows that each reached."""
        problem, kept = self._problem, list[tuple[slice, Float64[np.ndarray, " m"]]]()
        weights = self._weights.tolist()
        status, x, whole = SolveStatus.FAILED, self._solver.x, False
        try:
            for k, stage in enumerate(self._stages):
                if not soft[k]:
                    continue
                stage.fill(weights[k], self._reference)
                status = stage.solver.run(stage.problem)
                if status not in _USABLE:
                    return status, x
                x = stage.solver.x.copy()
                strain = weights[k] * self._strain(x)
                self._soft[k] = strain > 0.5 * self._tolerance
                whole = self._exact and k == len(self._stages) - 1
                if whole:
                    break
                rows = slice(problem.n + stage.rows.start, problem.n + stage.rows.stop)
                kept.append((rows, problem.lower[rows].copy()))
                reached = problem.A[stage.rows] @ x
                problem.lower[rows] = problem.upper[rows] = reached
            if not whole:
                status = self._solver.run(problem)
                x = self._solver.x.copy()
        finally:
            for rows, bounds in kept:
                problem.lower[rows] = problem.upper[rows] = bounds
        return status, x

    def _strain(self, x: Float64[np.ndarray, " n"]) -> float:
        """Return the distance of a point's variables from their reference."""
        largest = float(self._weights.max())
        return self._find(x) / largest if largest > 0.0 else 0.0
