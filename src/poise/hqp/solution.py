"""`Solution`: what a strategy found, with everything needed to judge it."""

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from jaxtyping import Bool, Float64

from poise.hqp.explain import Conflict, describe, find_conflicts
from poise.hqp.problem import HierarchicalProblem


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
        """List the rows that could not be met, with what stands in their way."""
        return find_conflicts(problem, self.x, self.slacks)

    def explain(self, problem: HierarchicalProblem) -> str:
        """Say in words which rows conflict, by how much, and with which tasks or limits.

        Args:
            problem: the problem as it was when it was solved.
        """
        if self.status is SolveStatus.BAD_PROBLEM:
            return f"{self.status.value}: numbers that are not finite, or bounds that cross"
        return describe(self.status.value, problem, self.conflicts(problem))
