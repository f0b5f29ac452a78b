"""How far a point is from meeting each row and each level, in the user's own units."""

import numpy as np
from jaxtyping import Float64

from poise.hqp.problem import HierarchicalProblem

FEASIBILITY_TOLERANCE = 1e-9
"""Largest violation, relative to the row's size at the point, of a row that counts as met."""


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


def signed_slacks(
    problem: HierarchicalProblem, values: Float64[np.ndarray, " nm"]
) -> Float64[np.ndarray, " nm"]:
    """Return the signed distance of row values outside `[lower, upper]`."""
    slacks: Float64[np.ndarray, " nm"] = np.maximum(values - problem.upper, 0.0)
    slacks -= np.maximum(problem.lower - values, 0.0)
    return slacks


def level_norms(
    problem: HierarchicalProblem, slacks: Float64[np.ndarray, " nm"]
) -> Float64[np.ndarray, " p"]:
    """Return `|W w_i|` of each level."""
    weighted = slacks * problem.weights
    return np.sqrt(np.dot(weighted * weighted, problem.membership))


def level_scales(problem: HierarchicalProblem) -> Float64[np.ndarray, " p"]:
    """Return each level's scale: `max(1, |W w_i|)` at `x = 0`."""
    at_zero = np.maximum(problem.lower, 0.0) + np.minimum(problem.upper, 0.0)
    return np.maximum(level_norms(problem, at_zero), 1.0)
