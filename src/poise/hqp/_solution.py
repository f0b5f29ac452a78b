"""`Solution`: what a strategy found, with everything needed to judge it and to say it in words."""

from collections.abc import Collection
from dataclasses import dataclass, field
from enum import Enum
from time import perf_counter

import numpy as np
from jaxtyping import Bool, Float64, Int64

from poise.hqp._certificate import Certificate, certify_point
from poise.hqp._faults import faults
from poise.hqp._measure import measure_point
from poise.hqp._problem import HierarchicalProblem
from poise.hqp._tolerances import OPPOSING_RATIO, VISIBLE_VIOLATION


class SolveStatus(Enum):
    """How a solve ended."""

    OPTIMAL = "optimal"
    """Checked against the rows; what could not be met stands in `residuals`."""
    INACCURATE = "inaccurate"
    """A finite point whose optimality or row residuals missed the documented tolerance."""
    TIME_LIMIT = "time_limit"
    """The time cap came first: `x` is the best point so far, zero if there was none."""
    BAD_PROBLEM = "bad_problem"
    """The problem holds NaN, infinite coefficients or crossing bounds; `x` is zero."""
    FAILED = "failed"
    """No usable point; `x` is zero."""

    @property
    def ok(self) -> bool:
        """Whether the point may be trusted without a look at the residuals."""
        return self is SolveStatus.OPTIMAL


_CANNOT, _ARE_NOT = "cannot be met", "are not met"


@dataclass(frozen=True, slots=True)
class Conflict:
    """One row that is not met; at an optimum of strict levels, one that could not be.

    Attributes:
        label: the task or limit the row comes from.
        level: index of the row's level, 0 is the highest.
        row: stacked index of the row; the first n are the simple bounds.
        violation: signed distance outside the row's bounds, in the row's unit.
        conflicting_with: labels of the rows that oppose it, strongest first.
    """

    label: str
    level: int
    row: int
    violation: float
    conflicting_with: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """A point and how it meets the levels. Every array is finite, whatever the status.

    Attributes:
        status: how the solve ended.
        x: the point.
        slacks: signed distance of the n bounds and m rows outside `[lower, upper]`: positive
            above, negative below, zero inside.
        residuals: `|W w_i|` of each level.
        relative_residuals: `residuals` divided by each level's scale, `max(1, |W w_i(0)|)`:
            what the level's slack would be at `x = 0`, and at least 1.
        multipliers: of the final cost over the bounds and rows: `H x + g + [I; A]^T multipliers`
            is zero; positive at an upper bound, negative at a lower one. None where the strategy
            has none. Rows that a level had to give up count as equalities here.
        strategy: name of the strategy, with the backend after a slash where there is one.
        strict: whether the strategy holds each level's optimum, and does not only weigh levels.
        relaxed: whether something had to give.
        iterations: solver iterations, all QPs together.
        timings: seconds by phase; "total" is the whole solve.
    """

    status: SolveStatus
    x: Float64[np.ndarray, " n"]
    slacks: Float64[np.ndarray, " nm"]
    residuals: Float64[np.ndarray, " p"]
    relative_residuals: Float64[np.ndarray, " p"]
    multipliers: Float64[np.ndarray, " nm"] | None = None
    strategy: str = ""
    strict: bool = True
    relaxed: bool = False
    iterations: int = 0
    timings: dict[str, float] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether the status is OPTIMAL."""
        return self.status is SolveStatus.OPTIMAL

    @property
    def active(self) -> Bool[np.ndarray, " nm"]:
        """Bounds and rows that hold the point: violated, or with a multiplier of the final cost."""
        active = self.slacks != 0.0
        if self.multipliers is not None:
            active |= self.multipliers != 0.0
        return active

    def conflicts(self, problem: HierarchicalProblem) -> list[Conflict]:
        """List the violated rows in order of priority, with what opposes each of them.

        What opposes a row are the others that carry a multiplier in the optimality conditions of
        its level, those of the level itself included.

        Args:
            problem: the problem as it was when it was solved.
        """
        norms = np.concatenate([np.ones(problem.n), np.linalg.norm(problem.A, axis=1)])
        found: list[Conflict] = []
        for level, multipliers in enumerate(self._multipliers_by_level(problem)):
            own = problem.level_of == level
            visible = VISIBLE_VIOLATION * max(1.0, float(np.abs(self.slacks[own]).max(initial=0.0)))
            rows = np.flatnonzero(own & (np.abs(self.slacks) > visible))
            names = _by_strength(problem, np.abs(multipliers) * norms) if len(rows) else []
            for row in rows.tolist():
                label = problem.label(row)
                against = tuple(name for name in names if name != label)
                found.append(Conflict(label, level, row, float(self.slacks[row]), against))
        return found

    def explain(self, problem: HierarchicalProblem, unnumbered: Collection[int] = ()) -> str:
        """Say in words which rows conflict, by how much, and with which tasks or limits.

        Args:
            problem: the problem as it was when it was solved.
            unnumbered: indices of levels that have no number, by which those after them go on.
        """
        if self.status is SolveStatus.BAD_PROBLEM:
            return f"{self.status.value}: {'; '.join(faults(problem))}"
        conflicts = self.conflicts(problem)
        if not conflicts:
            return f"{self.status.value}: every row of every level is met"
        # Only an optimum, level by level, shows that a row that is missed has to be.
        proven = self.ok and self.strict
        lines = [f"{self.status.value}: {len(conflicts)} rows {_CANNOT if proven else _ARE_NOT}"]
        groups: dict[tuple[int, str], list[Conflict]] = {}
        for conflict in conflicts:
            groups.setdefault((conflict.level, conflict.label), []).append(conflict)
        for (level, label), rows in groups.items():
            number = level + 1 - sum(other < level for other in unnumbered)
            which = "level without a number" if level in unnumbered else f"level {number}"
            lines.append(f"  {which} ({problem.level(level).name}): {_say(label, rows, proven)}")
        return "\n".join(lines)

    def certify(self, problem: HierarchicalProblem) -> Certificate:
        """Check the optimality conditions of every level and of the final cost at the point.

        Nothing that the solver says of itself is used: the multipliers are found anew.

        Args:
            problem: the problem as it was when it was solved.
        """
        return certify_point(problem, self.x)

    def _multipliers_by_level(
        self, problem: HierarchicalProblem
    ) -> tuple[Float64[np.ndarray, " nm"], ...]:
        """Multipliers of each level over bounds and rows."""
        return self.certify(problem).multipliers


@dataclass(frozen=True, slots=True, kw_only=True)
class LexicographicSolution(Solution):
    """A solution from which optimality can be checked without solving again.

    With `a_i` the coefficients of bound or row i, the conditions are, for each level k,

        sum_i level_multipliers[k, i] a_i = 0,
        level_multipliers[k, i] = weight_i^2 slack_i on the level's own rows, zero on those below,

    and `multipliers` balance the final cost in the same way. Of an inequality's multipliers,
    highest level first, the first that is not zero is positive at the upper bound and negative at
    the lower one; those after it may have either sign, for there the row is an equality.

    They hold for the bounds that damping moved: a row's slack is counted from there.

    Attributes:
        level_multipliers: of each level over the n bounds and m rows.
        sides: the active set: 1 at or above the upper bound, -1 at or below the lower one, 2 for
            an equality, 0 for a row that is not active. What `begin_with` takes.
        eased: square of the damping that each level needed, see `LexicographicSolver`.
        shift: by how much damping moved the bounds of equalities; zero where nothing is damped.
    """

    level_multipliers: Float64[np.ndarray, "p nm"]
    sides: Int64[np.ndarray, " nm"]
    eased: Float64[np.ndarray, " p"]
    shift: Float64[np.ndarray, " nm"]

    def _multipliers_by_level(
        self, problem: HierarchicalProblem
    ) -> tuple[Float64[np.ndarray, " nm"], ...]:
        del problem  # it carries them already
        return tuple(self.level_multipliers)


class KeepsSolution:
    """A solver whose `solve` makes a `Solution` anyway: `run` keeps it."""

    _kept: Solution | None = None

    def solve(self, problem: HierarchicalProblem) -> Solution:
        """Solve one problem; the answer owns its arrays."""
        raise NotImplementedError

    def prepare(self, problem: HierarchicalProblem) -> None:
        """Nothing: what such a solver needs is made in each solve."""

    def follow(self, problem: HierarchicalProblem, last: object) -> None:
        """Nothing: every solve starts cold."""

    def run(self, problem: HierarchicalProblem) -> SolveStatus:
        """Solve one problem and keep the answer."""
        self._kept = self.solve(problem)
        return self._kept.status

    def report(self) -> Solution:
        """All about the last `run`."""
        assert self._kept is not None, "nothing was run yet"
        return self._kept

    @property
    def x(self) -> Float64[np.ndarray, " n"]:
        """The point of the last `run`; empty before."""
        return np.zeros(0) if self._kept is None else self._kept.x

    @property
    def relative_residuals(self) -> Float64[np.ndarray, " p"]:
        """What each level leaves over there, see `Solution`; empty before."""
        return np.zeros(0) if self._kept is None else self._kept.relative_residuals


def failure(
    problem: HierarchicalProblem, status: SolveStatus, strategy: str, start: float
) -> Solution:
    """Return the answer where there is no point: x is zero, and everything in it is finite.

    The residuals of a bad problem say nothing and are zero; a sound one's are those of x = 0.
    """
    x, levels = np.zeros(problem.n), np.zeros(len(problem.levels))
    slacks, residuals, scales = np.zeros(problem.n + problem.m), levels, levels + 1.0
    if status is not SolveStatus.BAD_PROBLEM:
        # Squares of bounds near the largest number are none.
        largest = np.finfo(np.float64).max
        slacks, residuals, scales = measure_point(problem, x)
        residuals, scales = np.minimum(residuals, largest), np.minimum(scales, largest)
    return Solution(
        status=status,
        x=x,
        slacks=slacks,
        residuals=residuals,
        relative_residuals=residuals / scales,
        strategy=strategy,
        timings={"total": perf_counter() - start},
    )


def _by_strength(problem: HierarchicalProblem, forces: Float64[np.ndarray, " nm"]) -> list[str]:
    """Labels of the rows that carry a multiplier, the strongest first."""
    strength: dict[str, float] = {}
    for row in np.flatnonzero(forces).tolist():
        name = problem.label(row)
        strength[name] = strength.get(name, 0.0) + float(forces[row])
    least = OPPOSING_RATIO * max(strength.values(), default=0.0)
    ordered = sorted(strength.items(), key=lambda item: -item[1])
    return [name for name, force in ordered if force > least]


def _say(label: str, rows: list[Conflict], proven: bool) -> str:
    """How far the rows of a label miss, and against what; nobody knows where that is not proven."""
    worst = max(rows, key=lambda conflict: abs(conflict.violation))
    opponents = list(dict.fromkeys(name for c in rows for name in c.conflicting_with))
    against = f", against {', '.join(opponents)}" if opponents else ", by itself"
    against = against if proven else ""
    side = "above" if worst.violation > 0.0 else "below"
    return (
        f"{label!r} misses {len(rows)} of its rows, by up to {abs(worst.violation):.3g} {side} "
        f"its bound{against}"
    )
