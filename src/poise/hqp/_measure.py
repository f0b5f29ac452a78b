"""Slacks of rows and residuals of levels at a point, in the user's own units."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise.hqp._problem import HierarchicalProblem


class Measure(NamedTuple):
    """Violations of a problem's rows and levels at a point."""

    slacks: Float64[np.ndarray, " nm"]  # signed distances outside `[lower, upper]`, positive above
    residuals: Float64[np.ndarray, " p"]  # `|W w|` of each level
    scales: Float64[np.ndarray, " p"]  # `max(1, |W w|)` of each level at `x = 0`

    @property
    def relative(self) -> Float64[np.ndarray, " p"]:
        """`residuals` by the levels' scales."""
        return self.residuals / self.scales


def measure_point(problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]) -> Measure:
    """Return slacks, residuals and scales at a point."""
    slacks, residuals = _measure_values(problem, row_values(problem, x))
    scales = _measure_values(problem, np.zeros(problem.n + problem.m))[1]
    return Measure(slacks, residuals, np.maximum(scales, 1.0))


def _measure_values(
    problem: HierarchicalProblem, values: Float64[np.ndarray, " nm"]
) -> tuple[Float64[np.ndarray, " nm"], Float64[np.ndarray, " p"]]:
    above = np.maximum(values - problem.upper, 0.0)
    slacks = above - np.maximum(problem.lower - values, 0.0)
    # Squares of huge slacks are infinite.
    with np.errstate(over="ignore"):
        squares = (slacks * problem.weights) ** 2
        sums = np.bincount(problem.level_of, squares, len(problem.levels))
    return slacks, np.sqrt(sums)


def row_values(
    problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, " nm"]:
    """Return `[x; A x]`."""
    return np.concatenate([x, problem.A @ x])


def row_sizes(
    problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, " nm"]:
    """Return the size of the numbers that meet in each row: `max(1, |a| |x|)`.

    Rounding in `a^T x - b` is proportional to it, so tolerances on rows are relative to it.
    """
    norms = np.ones(problem.n + problem.m)
    norms[problem.n :] = np.linalg.norm(problem.A, axis=1)
    return np.maximum(1.0, norms * float(np.linalg.norm(x)))
