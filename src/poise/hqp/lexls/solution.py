"""`LexicographicSolution`: a solution with the multipliers of every level."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from poise.hqp.explain import Conflict
from poise.hqp.problem import HierarchicalProblem
from poise.hqp.solution import Solution

_VISIBLE = 1e-8
"""Violations below this, relative to the largest of the level, are not worth words."""

_STRONG = 1e-6
"""Pushes below this, relative to the strongest of the level, stand in nobody's way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LexicographicSolution(Solution):
    """A solution from which optimality can be checked without solving again.

    With `a_i` the coefficients of bound or row i, the conditions are, for each level k,

        sum_i level_multipliers[k, i] a_i = 0,
        level_multipliers[k, i] = weight_i^2 slack_i on the level's own rows, zero on those below,

    and `multipliers` balance the final cost likewise. Of an inequality's multipliers, highest level
    first, the first that is not zero is positive at the upper bound and negative at the lower one;
    those after it may have either sign, for there the row is an equality.

    They hold for the bounds that damping moved: a row's slack is counted from there.

    Attributes:
        level_multipliers: of each level over the n bounds and m rows.
        sides: the active set: 1 at or above the upper bound, -1 at or below the lower one, 2 for
            an equality, 0 for a row that is not active. What `warm_start` takes.
        eased: square of the damping that each level needed, see `LexicographicSolver`.
        shift: by how much damping moved the bounds of equalities; zero where nothing is damped.
    """

    level_multipliers: Float64[np.ndarray, "p nm"]
    sides: Int64[np.ndarray, " nm"]
    eased: Float64[np.ndarray, " p"]
    shift: Float64[np.ndarray, " nm"]

    def conflicts(self, problem: HierarchicalProblem) -> list[Conflict]:
        """List the rows that could not be met, with what pushes against them.

        Args:
            problem: the problem as it was when it was solved.
        """
        norms = np.concatenate([np.ones(problem.n), np.linalg.norm(problem.A, axis=1)])
        found: list[Conflict] = []
        for level, multipliers in enumerate(self.level_multipliers):
            mine = problem.level_of == level
            visible = _VISIBLE * max(1.0, float(np.abs(self.slacks[mine]).max(initial=0.0)))
            rows = np.flatnonzero(mine & (np.abs(self.slacks) > visible))
            if len(rows) == 0:
                continue
            names = _by_strength(problem, np.abs(multipliers) * norms)
            for row in rows.tolist():
                label = problem.label(row)
                against = tuple(name for name in names if name != label)
                found.append(Conflict(label, level, row, float(self.slacks[row]), against))
        return found


def _by_strength(problem: HierarchicalProblem, pushes: Float64[np.ndarray, " nm"]) -> list[str]:
    """Labels of the rows that push, the strongest first."""
    strength: dict[str, float] = {}
    for row in np.flatnonzero(pushes).tolist():
        name = problem.label(row)
        strength[name] = strength.get(name, 0.0) + float(pushes[row])
    least = _STRONG * max(strength.values(), default=0.0)
    ordered = sorted(strength.items(), key=lambda item: -item[1])
    return [name for name, push in ordered if push > least]
