"""`Solution`: answer of a strategy, with its residuals, conflicts and optimality conditions."""

from collections.abc import Collection
from dataclasses import dataclass, field
from enum import Enum
from time import perf_counter

import numpy as np
from jaxtyping import Bool, Float64, Int64

from poise.hqp._certificate import Certificate, certify_point
from poise.hqp._measure import measure_point
from poise.hqp._problem import HierarchicalProblem, faults
from poise.hqp._tolerances import COARSE, OPTIMALITY_TOLERANCE


class SolveStatus(Enum):
    """End of a solve."""

    OPTIMAL = "optimal"
    """Checked against the rows; `residuals` show levels that could not be met."""
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
        """True where the point may be trusted without a look at the residuals."""
        return self is SolveStatus.OPTIMAL


_CANNOT, _ARE_NOT = "cannot be met", "are not met"


@dataclass(frozen=True, slots=True)
class Conflict:
    """One row that is not met; at an optimum of strict levels, one that could not be."""

    label: str  # task or limit of the row
    level: int  # index of its level, 0 is the highest
    row: int  # its stacked index; the first n are the simple bounds
    violation: float  # signed distance outside its bounds, in its unit
    conflicting_with: tuple[str, ...]  # labels of the rows that oppose it, strongest first


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """A point and how it meets the levels. Every array is finite, whatever the status.

    A level's scale is `max(1, |W w_i(0)|)`, of its slack at `x = 0`. The multipliers of the final
    cost fulfil `H x + g + [I; A]^T multipliers = 0` and are positive at an upper bound, negative at
    a lower one; rows with slack count as equalities there.
    """

    status: SolveStatus
    x: Float64[np.ndarray, " n"]  # the point
    slacks: Float64[np.ndarray, " nm"]  # violations: > 0 above a bound, < 0 below one
    residuals: Float64[np.ndarray, " p"]  # `|W w_i|` of each level
    relative_residuals: Float64[np.ndarray, " p"]  # `residuals` by the levels' scales
    multipliers: Float64[np.ndarray, " nm"] | None = None  # of the final cost, if known
    strategy: str = ""  # name of the strategy, with the backend after a slash
    strict: bool = True  # True where each level is kept exactly, not by weights
    relaxed: bool = False  # True where some level is not met
    iterations: int = 0  # of the solver, all QPs together
    timings: dict[str, float] = field(default_factory=dict)  # [s], by phase and in "total"

    @property
    def ok(self) -> bool:
        """True where the status is OPTIMAL."""
        return self.status is SolveStatus.OPTIMAL

    @property
    def active(self) -> Bool[np.ndarray, " nm"]:
        """Bounds and rows that hold the point: violated, or with a multiplier of the final cost."""
        active = self.slacks != 0.0
        if self.multipliers is not None:
            active |= self.multipliers != 0.0
        return active

    def conflicts(self, problem: HierarchicalProblem) -> list[Conflict]:
        """List the violated rows in order of priority, with the rows that oppose each of them.

        Those are the rows with a multiplier in the optimality conditions of its level.

        Args:
            problem: the problem as it was when it was solved.
        """
        norms = np.concatenate([np.ones(problem.n), np.linalg.norm(problem.A, axis=1)])
        found: list[Conflict] = []
        for level, multipliers in enumerate(self._multipliers_by_level(problem)):
            own = problem.level_of == level
            visible = OPTIMALITY_TOLERANCE * max(
                1.0, float(np.abs(self.slacks[own]).max(initial=0.0))
            )
            rows = np.flatnonzero(own & (np.abs(self.slacks) > visible))
            names = _by_strength(problem, np.abs(multipliers) * norms) if len(rows) else []
            for row in rows.tolist():
                label = problem.label(row)
                against = tuple(name for name in names if name != label)
                found.append(Conflict(label, level, row, float(self.slacks[row]), against))
        return found

    def explain(self, problem: HierarchicalProblem, unnumbered: Collection[int] = ()) -> str:
        """Describe which rows conflict, by how much, and with which tasks or limits.

        Args:
            problem: the problem as it was when it was solved.
            unnumbered: indices of levels without a number; those after them continue the count.
        """
        if self.status is SolveStatus.BAD_PROBLEM:
            return f"{self.status.value}: {'; '.join(faults(problem))}"
        conflicts = self.conflicts(problem)
        if not conflicts:
            return f"{self.status.value}: every row of every level is met"
        # Only an optimum, level by level, proves that a row cannot be met.
        proven = self.ok and self.strict
        lines = [f"{self.status.value}: {len(conflicts)} rows {_CANNOT if proven else _ARE_NOT}"]
        groups: dict[tuple[int, str], list[Conflict]] = {}
        for conflict in conflicts:
            groups.setdefault((conflict.level, conflict.label), []).append(conflict)
        for (level, label), rows in groups.items():
            number = level + 1 - sum(other < level for other in unnumbered)
            which = "level without a number" if level in unnumbered else f"level {number}"
            lines.append(
                f"  {which} ({problem.level(level).name}): {_describe(label, rows, proven)}"
            )
        return "\n".join(lines)

    def certify(self, problem: HierarchicalProblem) -> Certificate:
        """Check the optimality conditions of every level and of the final cost at the point.

        The multipliers are recomputed, independently of the solver.

        Args:
            problem: the problem as it was when it was solved.
        """
        return certify_point(problem, self.x)

    def _multipliers_by_level(
        self, problem: HierarchicalProblem
    ) -> tuple[Float64[np.ndarray, " nm"], ...]:
        return self.certify(problem).multipliers


@dataclass(frozen=True, slots=True, kw_only=True)
class LexicographicSolution(Solution):
    """A solution with the multipliers of all levels, which prove its optimality.

    With `a_i` the coefficients of bound or row i, the conditions are, for each level k,

        sum_i level_multipliers[k, i] a_i = 0,
        level_multipliers[k, i] = weight_i^2 slack_i on the level's own rows, zero on those below,

    and `multipliers` balance the final cost in the same way. Of an inequality's multipliers,
    highest level first, the first that is not zero is positive at the upper bound and negative at
    the lower one; those after it may have either sign, for there the row is an equality.

    They hold for the bounds that damping moved: a row's slack is counted from there.
    """

    level_multipliers: Float64[np.ndarray, "p nm"]
    # 1 active at or above the upper bound, -1 at or below the lower one, 2 equality, 0 inactive
    sides: Int64[np.ndarray, " nm"]
    eased: Float64[np.ndarray, " p"]  # square of the damping that each level needed
    shift: Float64[np.ndarray, " nm"]  # displacement of equalities' bounds by damping

    def _multipliers_by_level(
        self, problem: HierarchicalProblem
    ) -> tuple[Float64[np.ndarray, " nm"], ...]:
        del problem
        return tuple(self.level_multipliers)


def failure(
    problem: HierarchicalProblem, status: SolveStatus, strategy: str, start: float
) -> Solution:
    """Return the answer x = 0 with its residuals, which are zero for a bad problem."""
    x, levels = np.zeros(problem.n), np.zeros(len(problem.levels))
    slacks, residuals, scales = np.zeros(problem.n + problem.m), levels, levels + 1.0
    if status is not SolveStatus.BAD_PROBLEM:
        # Squares of huge bounds are infinite.
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
    """Return the labels of the rows with a multiplier, the strongest first."""
    strength: dict[str, float] = {}
    for row in np.flatnonzero(forces).tolist():
        name = problem.label(row)
        strength[name] = strength.get(name, 0.0) + float(forces[row])
    least = COARSE * max(strength.values(), default=0.0)
    ordered = sorted(strength.items(), key=lambda item: -item[1])
    return [name for name, force in ordered if force > least]


def _describe(label: str, rows: list[Conflict], proven: bool) -> str:
    """Describe the rows of a label that are missed, with their opponents if proven."""
    worst = max(rows, key=lambda conflict: abs(conflict.violation))
    opponents = list(dict.fromkeys(name for c in rows for name in c.conflicting_with))
    against = f", against {', '.join(opponents)}" if opponents else ", by itself"
    against = against if proven else ""
    side = "above" if worst.violation > 0.0 else "below"
    return (
        f"{label!r} misses {len(rows)} of its rows, by up to {abs(worst.violation):.3g} {side} "
        f"its bound{against}"
    )
