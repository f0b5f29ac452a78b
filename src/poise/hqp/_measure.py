"""How far a point is from meeting each row and each level, in the user's own units.

Compiled, so that every strategy measures by the same few lines and the search may call them too.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.hqp._problem import HierarchicalProblem


class Measure(NamedTuple):
    """How a point meets a problem.

    Attributes:
        slacks: signed distance of bounds and rows outside `[lower, upper]`: positive above,
            negative below.
        residuals: `|W w|` of each level.
        scales: `max(1, |W w|)` of each level at `x = 0`.
    """

    slacks: Float64[np.ndarray, " nm"]
    residuals: Float64[np.ndarray, " p"]
    scales: Float64[np.ndarray, " p"]

    @property
    def relative(self) -> Float64[np.ndarray, " p"]:
        """`residuals` by the levels' scales."""
        return self.residuals / self.scales


def measure_point(problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]) -> Measure:
    """Return slacks, residuals and scales at a point."""
    slacks, levels = np.empty(problem.n + problem.m), len(problem.levels)
    measure = Measure(slacks, np.empty(levels), np.empty(levels))
    values = row_values(problem, x)
    numbers = problem.lower, problem.upper, problem.weights, problem.level_of
    find_slacks(problem.lower, problem.upper, values, slacks)
    find_residuals(*numbers, values, measure.residuals)
    find_residuals(*numbers, np.zeros(len(values)), measure.scales)
    np.maximum(measure.scales, 1.0, out=measure.scales)
    return measure


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


@compiled
def find_slacks(
    lower: Float64[np.ndarray, " nm"],
    upper: Float64[np.ndarray, " nm"],
    values: Float64[np.ndarray, " nm"],
    slacks: Float64[np.ndarray, " nm"],
) -> None:
    """Signed distances of row values outside `[lower, upper]`."""
    for i in range(len(values)):
        slacks[i] = max(values[i] - upper[i], 0.0) - max(lower[i] - values[i], 0.0)


@compiled
def find_residuals(
    lower: Float64[np.ndarray, " nm"],
    upper: Float64[np.ndarray, " nm"],
    weights: Float64[np.ndarray, " nm"],
    level_of: Int64[np.ndarray, " nm"],
    values: Float64[np.ndarray, " nm"],
    residuals: Float64[np.ndarray, " p"],
) -> None:
    """`|W w|` of each level."""
    residuals[:] = 0.0
    for i in range(len(values)):
        slack = max(values[i] - upper[i], 0.0) - max(lower[i] - values[i], 0.0)
        residuals[level_of[i]] += slack * weights[i] * (slack * weights[i])
    for level in range(len(residuals)):
        residuals[level] = sqrt(residuals[level])
