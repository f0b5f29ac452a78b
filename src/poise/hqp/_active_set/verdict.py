"""Whether the optimum that the search claims may be believed, and what a point amounts to.

All on the problem's own rows and numbers, not on those that were factored.
"""

import numpy as np
from jaxtyping import Float64

from poise.hqp._active_set.kernels import add_rows, copy, norm_of
from poise.hqp._active_set.workspace import Duals, Factor, Problem, Rows, Work
from poise.hqp._measure import find_residuals, find_slacks
from poise.hqp._tolerances import OPTIMALITY_TOLERANCE
from poise.linalg import part


@part
def measure(problem: Problem, work: Work) -> bool:
    """Slacks of all rows, residuals of all levels; returns whether all that was found is finite.

    Args:
        problem: the problem.
        work: whose answer is found at its point.
    """
    answer, values = work.answer, work.points.values
    lower, upper, weights, level = problem.lower, problem.upper, problem.weights, work.rows.level
    find_slacks(lower, upper, values, answer.slacks)
    find_residuals(lower, upper, weights, level, values, answer.residuals)
    # The levels' scales are their residuals at x = 0.
    work.rows.violation[:] = 0.0
    find_residuals(lower, upper, weights, level, work.rows.violation, answer.relative)
    for p in range(len(answer.residuals)):
        answer.relative[p] = answer.residuals[p] / max(answer.relative[p], 1.0)
    total = 0.0
    for j in range(len(work.points.x)):
        total += abs(work.points.x[j])
    for i in range(len(answer.slacks)):
        total += abs(answer.slacks[i])
        for p in range(len(work.duals.multipliers)):
            total += abs(work.duals.multipliers[p, i])
    for p in range(len(answer.residuals)):
        total += answer.residuals[p]
    return bool(total < np.inf)


@part
def is_optimal(problem: Problem, work: Work) -> bool:
    """Whether rows are where they should be, everything balances, and every sign is right.

    Args:
        problem: the problem.
        work: whose point and multipliers are to be the optimum's.
    """
    if work.states[0].doubtful != 0:
        return False
    factor, duals, norm = work.factor, work.duals, work.rows.norm
    levels, gradient = len(factor.rank), duals.gradient
    reach = _reach(factor, work.points.x)
    worst = _row_error(problem, work.rows, work.factor, work.points.values, reach)
    for level in range(levels):
        if factor.begin[level] < factor.begin[level + 1]:
            gradient[:] = 0.0
            worst = max(worst, _imbalance(problem.A, norm, factor, duals, level, 0.0))
    size = 0.0
    for i in range(len(gradient)):
        size = max(size, abs(problem.g[i]), abs(problem.H[i, i]) * reach)
    copy(gradient, work.cost.gradient)
    worst = max(worst, _imbalance(problem.A, norm, factor, duals, levels, size))
    return bool(worst <= OPTIMALITY_TOLERANCE)


@part
def _row_error(
    problem: Problem,
    rows: Rows,
    factor: Factor,
    values: Float64[np.ndarray, " nm"],
    reach: float,
) -> float:
    """How far rows are from where they should be, relatively; inactive ones inside their bounds."""
    worst = 0.0
    for place in range(factor.begin[len(factor.rank)]):
        index = factor.order[place]
        bound = factor.bound[place]
        miss = abs(values[index] * problem.weights[index] - bound - factor.slack[place])
        scale = abs(bound) + factor.size[place] * reach
        # Written so that NaN is an error, too.
        if not (miss < np.inf and abs(bound) < np.inf):
            return np.inf
        if miss > worst * scale:
            worst = miss / scale
    for i in range(len(values)):
        if rows.side[i] == 0:
            miss = max(values[i] - problem.upper[i], problem.lower[i] - values[i], 0.0)
            scale = rows.norm[i] * reach
            if not miss < np.inf:
                return np.inf
            if miss > worst * scale:
                worst = miss / scale if scale > 0.0 else np.inf
    return worst


@part
def _reach(factor: Factor, x: Float64[np.ndarray, " n"]) -> float:
    """How far x is, or would be if it met the rows that are active one by one."""
    reach = norm_of(x)
    for place in range(factor.begin[len(factor.rank)]):
        if factor.size[place] > 0.0:
            reach = max(reach, abs(factor.bound[place]) / factor.size[place])
    return reach


@part
def _imbalance(
    A: Float64[np.ndarray, "m n"],
    norm: Float64[np.ndarray, " nm"],
    factor: Factor,
    duals: Duals,
    level: int,
    size: float,
) -> float:
    """What a level's multipliers, times the rows, leave of its gradient, relatively."""
    gradient, chosen, found = duals.gradient, duals.chosen, duals.multipliers[level]
    n, count = len(gradient), 0
    for place in range(factor.begin[len(factor.rank)]):
        index = factor.order[place]
        multiplier = found[index]
        size = max(size, abs(multiplier) * norm[index])
        if index < n:
            gradient[index] += multiplier
        elif multiplier != 0.0:
            chosen[count] = index - n
            count += 1
    add_rows(gradient, A, found, chosen, count, n)
    left = 0.0
    for j in range(n):
        if not abs(gradient[j]) < np.inf:
            return np.inf
        left = max(left, abs(gradient[j]))
    return left / size if left > 0.0 else left
