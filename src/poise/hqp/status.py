"""Telling a problem that cannot be solved from one that was not, and answering for both."""

from time import perf_counter

import numpy as np

from poise.hqp.measure import level_norms, level_scales, row_values, signed_slacks
from poise.hqp.problem import HierarchicalProblem
from poise.hqp.solution import Solution, SolveStatus


def is_sound(problem: HierarchicalProblem) -> bool:
    """Return whether the numbers can be a problem: finite coefficients, bounds in order."""
    return bool(
        np.isfinite(problem.A).all()
        and np.isfinite(problem.H).all()
        and np.isfinite(problem.g).all()
        and (np.isfinite(problem.weights) & (problem.weights > 0.0)).all()
        and (problem.lower <= problem.upper).all()
        and (problem.lower < np.inf).all()
        and (problem.upper > -np.inf).all()
    )


def failure(
    problem: HierarchicalProblem, status: SolveStatus, strategy: str, start: float
) -> Solution:
    """Return the answer where there is no point: x is zero, and everything in it is finite.

    The residuals of a bad problem say nothing and are zero; a sound one's are those of x = 0.
    """
    levels = len(problem.levels)
    slacks = np.zeros(problem.n + problem.m)
    residuals = np.zeros(levels)
    relative = np.zeros(levels)
    x = np.zeros(problem.n)
    if status is not SolveStatus.BAD_PROBLEM:
        slacks = signed_slacks(problem, row_values(problem, x))
        # Squares of bounds near the largest number are none.
        with np.errstate(over="ignore"):
            largest = np.finfo(np.float64).max
            residuals = np.minimum(level_norms(problem, slacks), largest)
            relative = residuals / np.minimum(level_scales(problem), largest)
    return Solution(
        status=status,
        x=x,
        slacks=slacks,
        residuals=residuals,
        relative_residuals=relative,
        strategy=strategy,
        timings={"total": perf_counter() - start},
    )
