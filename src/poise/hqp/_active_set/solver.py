"""`LexicographicSolver`: the compiled search in a workspace that persists."""

from time import perf_counter

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import checked_time_limit
from poise._compiled import say_if_slow
from poise.errors import ConfigurationError, ProblemError
from poise.hqp._active_set.search import CONVERGED, LOST, UNFINISHED, UNSOUND, search
from poise.hqp._active_set.workspace import Problem, SearchWork, make_work
from poise.hqp._problem import HierarchicalProblem, Level, Numbers
from poise.hqp._solution import LexicographicSolution, Solution, SolveStatus, failure
from poise.hqp._tolerances import MET_TOLERANCE, changes_allowed

ENDS = {
    CONVERGED: SolveStatus.OPTIMAL,
    UNSOUND: SolveStatus.BAD_PROBLEM,
    LOST: SolveStatus.FAILED,
}
"""Statuses of the ends of a search that are not inaccurate."""


class LexicographicSolver:
    """Solve hierarchies by one active set and one factorisation for all levels.

    The workspace persists: a controller keeps one solver and calls `solve` or `run` every tick, and
    each call begins with the active set of the last. As long as that stays the same, a call takes
    one factorisation. No number raises.

        >>> import numpy as np
        >>> from poise.hqp import HierarchicalProblem, Level, LexicographicSolver
        >>> limit = Level(np.array([[1.0, 0.0]]), -np.inf, 1.0)
        >>> task = Level(np.array([[1.0, 0.0], [0.0, 1.0]]), [3.0, 4.0], [3.0, 4.0])
        >>> solution = LexicographicSolver().solve(HierarchicalProblem([limit, task]))
        >>> solution.x
        array([1., 4.])
        >>> solution.residuals
        array([0., 2.])
        >>> solution.level_multipliers[1]
        array([ 0.,  0.,  2., -2.,  0.])

    The first solver on a machine compiles the search, which takes some twenty seconds and is kept
    on disk. Constructing a solver is never cheap: do so before the control loop begins.

    Args:
        time_limit: cap on a solve [s]; None for none.
        max_changes: cap on the changes of the active set in a solve; by default one that grows
            with the problem.
        damping: of each level, or of all; 0 for none. Where the least singular value s of a
            level's weighted equalities, in the null space of those above, is less than its damping
            d, their bounds move to where the z with the least `|W w|^2 + (d^2 - s^2) |z|^2` is, z
            being the coordinates of x that they take. So x is bounded near singularities, the
            levels above lose nothing, and away from singularities the answer is exact.

    Raises:
        ConfigurationError: a cap that is not positive, a damping that is negative or not finite.
    """

    name = "direct"

    def __init__(
        self,
        time_limit: float | None = None,
        max_changes: int | None = None,
        damping: Numbers = 0.0,
    ) -> None:
        self._asked_damping = _check_damping(damping)
        if max_changes is not None and max_changes < 1:
            raise ConfigurationError("max_changes must be positive", got=max_changes, wanted=">= 1")
        self.time_limit = checked_time_limit(time_limit)
        self._max_changes = max_changes
        self._shape: tuple[int, ...] = ()
        self._fitted: HierarchicalProblem | None = None
        self._shared: dict[
            tuple[HierarchicalProblem, HierarchicalProblem],
            tuple[Int64[np.ndarray, " s"], Int64[np.ndarray, " s"]],
        ] = {}
        self._status, self._seconds = SolveStatus.FAILED, 0.0
        self._compile()

    def _compile(self) -> None:
        """Solve a tiny problem, so that nothing is compiled in a control loop."""
        say_if_slow(search, "the hierarchical solver")
        level = Level([[1.0]], 1.0, 2.0)
        self.run(HierarchicalProblem([level] * max(self._asked_damping.size, 1)))
        self._shape, self._fitted = (), None

    def reset(self) -> None:
        """Forget the last active set, so that the next solve starts cold."""
        if self._shape:
            self._work.points.x[:] = 0.0
            self._work.rows.side[:] = self._work.rows.needed_by[:] = 0

    def begin_with(self, problem: HierarchicalProblem, sides: Int64[np.ndarray, " nm"]) -> None:
        """Make the next solve, of a problem of this shape, begin with an active set.

        Args:
            problem: a problem of that shape.
            sides: as in `LexicographicSolution`; a start only, the answer is checked.

        Raises:
            ProblemError: not one entry a bound and row.
            ConfigurationError: as for `run`.
        """
        if sides.shape != problem.lower.shape:
            raise ProblemError(
                "sides are not an active set of this problem",
                got=sides.shape,
                wanted=f"{problem.lower.shape}",
            )
        self._fit(problem)
        self._work.rows.side[:] = np.clip(sides, -1, 2)
        # Those of the last solve are not of this active set.
        self._work.duals.multipliers[:] = 0.0

    def follow(self, problem: HierarchicalProblem, last: object) -> None:
        """Begin the next solve, of a problem, with the active set that another solver found.

        Rows without a counterpart there begin as this solver's last solve left them.

        Args:
            problem: the next problem, such as that of another set of contacts.
            last: the other solver; rows of its last problem are matched by their labels.

        Raises:
            ConfigurationError: as for `run`.
        """
        if not isinstance(last, LexicographicSolver) or last._fitted is None:
            return
        other = last._fitted
        rows = self._shared.get((problem, other))
        if rows is None:
            rows = self._shared[problem, other] = problem.rows_shared_with(other)
        here, there = rows
        self._fit(problem)
        self._work.rows.side[here] = last.sides[there]

    def prepare(self, problem: HierarchicalProblem) -> None:
        """Allocate the workspace for a problem's shape ahead of the first solve.

        Args:
            problem: of that shape; its numbers do not matter.

        Raises:
            ConfigurationError: as for `run`.
        """
        self._fit(problem)

    def memory_for(self, problem: HierarchicalProblem) -> tuple[Problem, SearchWork, int]:
        """Return the arguments of `search` for a problem, for compiled code that calls it.

        Args:
            problem: a problem; its numbers may change afterwards, its arrays may not.

        Returns:
            The block of its arrays, the workspace, and the cap on changes.

        Raises:
            ConfigurationError: as for `run`.
        """
        self._fit(problem)
        return self._problem, self._work, self._limit

    def run(self, problem: HierarchicalProblem) -> SolveStatus:
        """Solve one problem without allocation: the answer stays in the workspace.

        Args:
            problem: of any shape; a new shape allocates a new workspace.

        Returns:
            The status; the answer is in `x`, `slacks`, `residuals`, `relative_residuals`,
            `multipliers`, `sides`, `eased`, `shift` and `changes` until the next call.

        Raises:
            ConfigurationError: the number of levels is not that of `damping`.
        """
        begin = perf_counter()
        self._fit(problem)
        # The time of a new workspace counts, but not against the cap.
        found, late = self._run_search()
        self._status = self._status_of(found, late)
        self._seconds = perf_counter() - begin
        return self._status

    def _run_search(self) -> tuple[int, bool]:
        """Search up to the cap on changes; return the end, and whether time ran out."""
        self._work.state.begun = 0
        if self.time_limit is None:
            return self._search(self._limit), False
        deadline = perf_counter() + self.time_limit
        for allowed in range(1, self._limit + 1):
            found = self._search(allowed)
            if found != UNFINISHED:
                return found, False
            if perf_counter() > deadline:
                return found, True
        return UNFINISHED, False

    def _search(self, changes: int) -> int:
        return search(self._problem.address, self._work.address, changes)

    def _status_of(self, found: int, late: bool) -> SolveStatus:
        """Return the status; reset the parts of the workspace that are not usable."""
        if found == UNSOUND:
            self._work.rows.side[:] = 0
        elif found == LOST:
            self.reset()
        return ENDS.get(found, SolveStatus.TIME_LIMIT if late else SolveStatus.INACCURATE)

    def solve(self, problem: HierarchicalProblem) -> Solution:
        """Solve one problem; the answer owns its arrays.

        Args:
            problem: of any shape; a new shape allocates a new workspace.

        Returns:
            A `LexicographicSolution`, or a plain failure where there is no point.

        Raises:
            ConfigurationError: as for `run`.
        """
        self.run(problem)
        return self.report()

    def report(self) -> Solution:
        """Return the solution of the last `run`; it owns its arrays."""
        status, problem = self._status, self._fitted
        assert problem is not None
        if status in (SolveStatus.BAD_PROBLEM, SolveStatus.FAILED):
            return failure(problem, status, self.name, perf_counter() - self._seconds)
        return LexicographicSolution(
            status=status,
            x=self.x.copy(),
            slacks=self.slacks.copy(),
            residuals=self.residuals.copy(),
            relative_residuals=self.relative_residuals.copy(),
            multipliers=self.multipliers[-1].copy(),
            level_multipliers=self.multipliers[:-1].copy(),
            sides=self.sides.copy(),
            eased=self.eased.copy(),
            shift=self.shift.copy(),
            strategy=self.name,
            relaxed=bool(self.relative_residuals.max() > MET_TOLERANCE),
            iterations=self.changes,
            timings={"total": self._seconds},
        )

    @property
    def x(self) -> Float64[np.ndarray, " n"]:
        """Solution of the last `run`."""
        return self._work.points.x

    @property
    def slacks(self) -> Float64[np.ndarray, " nm"]:
        """Signed distance of bounds and rows outside their interval, as the last `run` left it."""
        return self._work.answer.slacks

    @property
    def residuals(self) -> Float64[np.ndarray, " p"]:
        """`|W w|` of each level, as the last `run` left it."""
        return self._work.answer.residuals

    @property
    def relative_residuals(self) -> Float64[np.ndarray, " p"]:
        """`residuals` divided by each level's scale, see `Solution`."""
        return self._work.answer.relative

    @property
    def multipliers(self) -> Float64[np.ndarray, "p1 nm"]:
        """Multipliers of each level, then of the final cost, as the last `run` left them."""
        return self._work.duals.multipliers

    @property
    def sides(self) -> Int64[np.ndarray, " nm"]:
        """The active set, see `LexicographicSolution`, as the last `run` left it."""
        return self._work.rows.side

    @property
    def eased(self) -> Float64[np.ndarray, " p"]:
        """Square of the damping that each level needed, as the last `run` left it."""
        return self._work.answer.eased

    @property
    def shift(self) -> Float64[np.ndarray, " nm"]:
        """Displacement of the bounds of equalities by damping, as the last `run` left it."""
        return self._work.rows.shift

    @property
    def changes(self) -> int:
        """Number of factorisations of the last `run`."""
        return self._work.state.changes

    def _fit(self, problem: HierarchicalProblem) -> None:
        """Take the addresses of a problem's arrays, and a new workspace for a new shape."""
        if problem is self._fitted and self._shape:
            return
        starts = [view.slice.start for view in problem.levels]
        shape = (problem.n, problem.m, *starts, problem.bounds_level)
        if shape != self._shape:
            if self._asked_damping.size not in (1, len(starts)):
                raise ConfigurationError(
                    "damping needs one entry a level",
                    got=self._asked_damping.size,
                    wanted=f"1 or {len(starts)}",
                )
            self._shape = shape
            self._damping = np.broadcast_to(self._asked_damping, len(starts)).copy()
            self._starts = np.array([*starts, problem.m], dtype=np.int64)
            self._work = make_work(problem.n, problem.m, len(starts))
            self._work.rows.level[:] = problem.level_of
            self._limit = self._max_changes or changes_allowed(problem.n, problem.m)
        self._fitted = problem
        self._problem = Problem(
            A=problem.A,
            lower=problem.lower,
            upper=problem.upper,
            weights=problem.weights,
            H=problem.H,
            g=problem.g,
            damping=self._damping,
            starts=self._starts,
            bounds_level=problem.bounds_level,
        )


def _check_damping(damping: Numbers) -> Float64[np.ndarray, " p"]:
    found = np.atleast_1d(np.asarray(damping, dtype=np.float64))
    if found.ndim != 1 or found.size == 0 or not np.isfinite(found).all() or found.min() < 0.0:
        raise ConfigurationError(
            "damping is out of range", got=damping, wanted="a finite number >= 0, or one a level"
        )
    return found
