"""`SoftenedSolver`: levels softened towards a reference where they cannot be met.

`search_softened`: the same for the compiled search, in one compiled call.
"""

from collections.abc import Callable, Mapping, Sequence
from math import sqrt
from time import perf_counter

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, address_of, call_at, compiled, part, view
from poise.hqp._active_set import (
    CONVERGED,
    ENDS,
    LOST,
    UNSOUND,
    LexicographicSolver,
    Problem,
    SearchWork,
    begin_with,
    copy,
    find_values,
    measure,
    search,
)
from poise.hqp._measure import measure_point
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


class SofteningProgram(MemoryBlock):
    """Hierarchy and softened levels for `search_softened`."""

    search: int  # address of its machine code
    problem: int  # address of the hierarchy's `Problem`
    work: int  # address of its `SearchWork`, which receives the answer
    changes: int  # most changes of the active set
    exact: int  # 1 where the last softened level decides the whole answer
    stages: Int64[np.ndarray, "s five"]  # the same three of each level; its first row, and its end
    columns: Int64[np.ndarray, " j"]  # variables of the reference
    reference: Float64[np.ndarray, " j"]
    weights: Float64[np.ndarray, " s"]  # mu of each level
    tolerance: Float64[np.ndarray, " one"]  # weighted distance below which a level is strict
    soft: Int64[np.ndarray, " s"]  # 1 for levels to soften at first
    softened: Float64[np.ndarray, " s"]  # receives mu of the softened levels, 0 for the others
    x: Float64[np.ndarray, " n"]
    lower: Float64[np.ndarray, " nm"]  # the hierarchy's bounds, while it has others
    upper: Float64[np.ndarray, " nm"]


@compiled
def search_softened(program_at: int, strict: int) -> int:
    """Soften the levels of the last call, then those that strain, the lowest first.

    `strict` is the end of the search without softening, -1 where it was not made.
    """
    p = view(SofteningProgram, program_at)
    problem, work = view(Problem, p.problem), view(SearchWork, p.work)
    levels, found, soft = len(p.weights), strict, 0
    for k in range(levels):
        p.softened[k] = p.weights[k] if p.soft[k] == 1 else 0.0
        soft += p.softened[k] > 0.0
    while True:
        if soft > 0:
            found = _search_stages(p, problem, work)
            if found in (UNSOUND, LOST):
                # Without an answer of the softened levels, strict ones may have one.
                p.soft[:], p.softened[:] = 0, 0.0
                return _search_anew(p.search, p.problem, p.work, p.changes)
        else:
            if found < 0:
                found = _search_anew(p.search, p.problem, p.work, p.changes)
            copy(p.x, work.points.x)
            if found in (UNSOUND, LOST):
                return found
        distance, straining = _distance(p), -1
        for k in range(levels):
            # Zero times an infinite distance is no number, and would strain for ever.
            free = p.weights[k] > 0.0 and p.softened[k] == 0.0
            if free and not p.weights[k] * distance <= p.tolerance[0]:
                straining = k
        if straining < 0:
            break
        p.softened[straining] = p.weights[straining]
        soft += 1
        own = view(SearchWork, p.stages[straining, 1])
        begin_with(own, work.rows.side[: len(p.x) + p.stages[straining, 4]])
    copy(work.points.x, p.x)
    find_values(problem.A, p.x, work.points.values)
    return found if measure(problem, work) else LOST


@part
def _search_stages(p: SofteningProgram, problem: Problem, work: SearchWork) -> int:
    """Search with some levels softened, highest first, and hold the rows that each reached."""
    n, found, whole = len(p.x), CONVERGED, False
    copy(p.lower, problem.lower)
    copy(p.upper, problem.upper)
    for k in range(len(p.weights)):
        if p.softened[k] == 0.0:
            continue
        at, changes, first, end = p.stages[k, 0], p.stages[k, 2], p.stages[k, 3], p.stages[k, 4]
        _fill(view(Problem, at), problem, end, p.weights[k], p.reference)
        found = _search_anew(p.search, at, p.stages[k, 1], changes)
        if found in (UNSOUND, LOST):
            break
        copy(p.x, view(SearchWork, p.stages[k, 1]).points.x)
        p.soft[k] = int(p.weights[k] * _distance(p) > 0.5 * p.tolerance[0])
        whole = p.exact == 1 and k == len(p.weights) - 1
        if whole:
            break
        for i in range(first, end):
            row, reached = problem.A[i], 0.0
            for j in range(n):
                reached += row[j] * p.x[j]
            problem.lower[n + i] = problem.upper[n + i] = reached
    if not whole and found not in (UNSOUND, LOST):
        found = _search_anew(p.search, p.problem, p.work, p.changes)
        copy(p.x, work.points.x)
    copy(problem.lower, p.lower)
    copy(problem.upper, p.upper)
    return found


@part
def _fill(
    own: Problem,
    problem: Problem,
    end: int,
    weight: float,
    reference: Float64[np.ndarray, " j"],
) -> None:
    """Copy the rows down to a level, and set weight and target of the reference's rows."""
    n = len(problem.g)
    for i in range(end):
        copy(own.A[i], problem.A[i])
    for i in range(n):
        copy(own.H[i], problem.H[i])
    copy(own.g, problem.g)
    copy(own.lower[: n + end], problem.lower)
    copy(own.upper[: n + end], problem.upper)
    copy(own.weights[: n + end], problem.weights)
    for j in range(len(reference)):
        own.lower[n + end + j] = own.upper[n + end + j] = reference[j]
        own.weights[n + end + j] = weight


@part
def _search_anew(code: int, problem_at: int, work_at: int, changes: int) -> int:
    """Search; what is not usable is forgotten."""
    work = view(SearchWork, work_at)
    work.state.begun = 0
    found = call_at(code, search, problem_at, work_at, changes)
    if found in (UNSOUND, LOST):
        work.points.x[:] = 0.0
        work.rows.side[:] = 0
        work.rows.needed_by[:] = 0
    return found


@part
def _distance(p: SofteningProgram) -> float:
    """Return the distance of a point's variables from their reference."""
    square = 0.0
    for j in range(len(p.columns)):
        off = p.x[p.columns[j]] - p.reference[j]
        square += off * off
    return sqrt(square)


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
        self._soft = np.zeros(len(levels), dtype=np.int64)
        self._any_soft = False
        self._found: tuple[Float64[np.ndarray, " _"], ...] | None = None
        self._status, self._seconds = SolveStatus.FAILED, 0.0
        solver.prepare(problem)
        # For `search_softened`; None with other solvers and with a time limit
        self.program = self._compiled_program(columns)
        self.reset()

    @property
    def x(self) -> Float64[np.ndarray, " n"]:
        """The answer of the last `run`."""
        return self._solver.x if self._found is None else self._found[0]

    @property
    def relative_residuals(self) -> Float64[np.ndarray, " p"]:
        """Residuals of the problem's levels by their scales, as the problem was set."""
        return self._solver.relative_residuals if self._found is None else self._found[3]

    def run(self) -> SolveStatus:
        """Solve the problem as it is; the answer stays here until the next call."""
        solver, strict = self._solver, None
        if not self._any_soft:
            strict = status = solver.run(self._problem)
            if status not in _USABLE or self._find(solver.x) <= self._tolerance:
                if self._found is not None:
                    self._found, self.softened[:] = None, 0.0
                return status
        else:
            self._find(solver.x)
        begin = perf_counter()
        if self.program is None:
            self._status = self._solve(strict)
        else:
            self._status = self._search(self.program, strict)
        self._any_soft = bool(self._soft.any())
        self._seconds = perf_counter() - begin
        return self._status

    def reset(self) -> None:
        """Forget the last solutions."""
        self._solver.reset()
        for stage in self._stages:
            stage.solver.reset()
        self._soft[:], self.softened[:] = 0, 0.0
        self._any_soft, self._found = False, None

    def follow(self, last: "SoftenedSolver") -> None:
        """Begin the next solve where that of another problem ended, such as of other contacts."""
        self._solver.follow(self._problem, last._solver)
        others = {stage.key: k for k, stage in enumerate(last._stages)}
        for k, stage in enumerate(self._stages):
            other = others.get(stage.key)
            if other is not None:
                stage.solver.follow(stage.problem, last._stages[other].solver)
            self._soft[k] = 0 if other is None else last._soft[other]
        self._any_soft = bool(self._soft.any())

    def report(self) -> Solution:
        """Return the solution of the last `run`; it owns its arrays."""
        if self._found is None:
            return self._solver.report()
        x, slacks, residuals, relative = (numbers.copy() for numbers in self._found)
        return Solution(
            status=self._status,
            x=x,
            slacks=slacks,
            residuals=residuals,
            relative_residuals=relative,
            strategy="softened",
            relaxed=bool(relative.max() > MET_TOLERANCE),
            timings={"total": self._seconds},
        )

    def _compiled_program(self, columns: Sequence[int]) -> SofteningProgram | None:
        places = [(self._solver, self._problem)]
        places += [(stage.solver, stage.problem) for stage in self._stages]
        # Blocks whose addresses the program has.
        self._memory = [
            solver.memory_for(problem)
            for solver, problem in places
            if isinstance(solver, LexicographicSolver) and solver.time_limit is None
        ]
        if len(self._memory) < len(places):
            return None
        numbers = [(problem.address, work.address, most) for problem, work, most in self._memory]
        stages = [
            (*found, stage.rows.start, stage.rows.stop)
            for found, stage in zip(numbers[1:], self._stages, strict=True)
        ]
        program = SofteningProgram(
            search=address_of(search),
            problem=numbers[0][0],
            work=numbers[0][1],
            changes=numbers[0][2],
            exact=int(self._exact),
            stages=np.array(stages, dtype=np.int64).reshape(-1, 5),
            columns=np.array(columns, dtype=np.int64),
            reference=self._reference,
            weights=self._weights,
            tolerance=np.array([self._tolerance]),
            soft=self._soft,
            softened=self.softened,
            x=np.zeros(self._problem.n),
            lower=np.zeros(self._problem.n + self._problem.m),
            upper=np.zeros(self._problem.n + self._problem.m),
        )
        # What is compiled is compiled now, not in a control loop.
        search_softened(program.address, CONVERGED)
        return program

    def _search(self, program: SofteningProgram, strict: SolveStatus | None) -> SolveStatus:
        found = search_softened(program.address, -1 if strict is None else CONVERGED)
        work = self._memory[0][1]
        answer = work.answer
        self._found = work.points.x, answer.slacks, answer.residuals, answer.relative
        return ENDS.get(found, SolveStatus.INACCURATE)

    def _solve(self, strict: SolveStatus | None) -> SolveStatus:
        """Soften the levels of the last solve, then those that strain, the lowest first."""
        weights = self._weights.tolist()
        soft = [was == 1 and mu > 0.0 for was, mu in zip(self._soft.tolist(), weights, strict=True)]
        while True:
            if any(soft):
                status, x = self._solve_softened(soft)
            else:
                status = strict or self._solver.run(self._problem)
                x = self._solver.x
            if status not in _USABLE:
                # Without an answer of the softened levels, strict ones may have one.
                soft, self._soft[:] = [False] * len(soft), 0
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
        measured = measure_point(self._problem, x)
        self._found = x, measured.slacks, measured.residuals, measured.relative
        self.softened[:] = np.where(soft, self._weights, 0.0)
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
