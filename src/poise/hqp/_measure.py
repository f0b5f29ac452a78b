"""Slacks of rows and residuals of levels at a point, in the user's own units.

Compiled, so that every strategy measures by the same lines and the search calls them too.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, allocate, compiled, part, view
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


class _PointNumbers(MemoryBlock):
    """A problem and a point."""

    A: Float64[np.ndarray, "m n"]
    lower: Float64[np.ndarray, " nm"]
    upper: Float64[np.ndarray, " nm"]
    weights: Float64[np.ndarray, " nm"]
    level_of: Int64[np.ndarray, " nm"]
    x: Float64[np.ndarray, " n"]
    values: Float64[np.ndarray, " nm"]  # of bounds and rows
    slacks: Float64[np.ndarray, " nm"]
    residuals: Float64[np.ndarray, " p"]
    scales: Float64[np.ndarray, " p"]


class PointMeasure:
    """Measure of points of one problem, whose numbers may change, in memory that stays."""

    def __init__(self, problem: HierarchicalProblem) -> None:
        sizes = {"n": problem.n, "nm": problem.n + problem.m, "p": len(problem.levels)}
        self._numbers = numbers = allocate(
            _PointNumbers,
            sizes,
            A=problem.A,
            lower=problem.lower,
            upper=problem.upper,
            weights=problem.weights,
            level_of=problem.level_of,
        )
        self._measure = Measure(numbers.slacks, numbers.residuals, numbers.scales)
        # Compiled now, not in a control loop.
        _measure(numbers.address)

    def at(self, x: Float64[np.ndarray, " n"]) -> Measure:
        """Return slacks, residuals and scales at a point, overwritten by the next call."""
        self._numbers.x[:] = x
        _measure(self._numbers.address)
        return self._measure


def measure_point(problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]) -> Measure:
    """Return slacks, residuals and scales at a point."""
    return PointMeasure(problem).at(x)


@compiled
def _measure(address: int) -> None:
    m = view(_PointNumbers, address)
    n, values = len(m.x), m.values
    for i in range(len(values)):
        values[i] = 0.0
    measure_values(m.lower, m.upper, m.weights, m.level_of, values, m.slacks, m.scales)
    for level in range(len(m.scales)):
        m.scales[level] = max(m.scales[level], 1.0)
    for i in range(n):
        values[i] = m.x[i]
    for i in range(len(m.A)):
        row, total = m.A[i], 0.0
        for j in range(n):
            total += row[j] * m.x[j]
        values[n + i] = total
    measure_values(m.lower, m.upper, m.weights, m.level_of, values, m.slacks, m.residuals)


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


@part
def measure_values(
    lower: Float64[np.ndarray, " nm"],
    upper: Float64[np.ndarray, " nm"],
    weights: Float64[np.ndarray, " nm"],
    level_of: Int64[np.ndarray, " nm"],
    values: Float64[np.ndarray, " nm"],
    slacks: Float64[np.ndarray, " nm"],
    residuals: Float64[np.ndarray, " p"],
) -> None:
    """Find the signed slacks of rows of such values, and `|W w|` of each level."""
    residuals[:] = 0.0
    for i in range(len(values)):
        slack = max(values[i] - upper[i], 0.0) - max(lower[i] - values[i], 0.0)
        slacks[i] = slack
        residuals[level_of[i]] += slack * weights[i] * (slack * weights[i])
    for level in range(len(residuals)):
        residuals[level] = sqrt(residuals[level])
