"""Strictness of an answer: no level gets worse once it has been solved.

The coordinates of a level leave the levels above as they are, with two exceptions. A row that
depends on those before it to within `RANK_TOLERANCE` has no coordinate, so that a long step below
moves it nevertheless. And the rounding of a very long step moves every row.
"""

from math import sqrt

import numpy as np

from poise._compiled import part
from poise.hqp._active_set.multipliers import natural_reach
from poise.hqp._active_set.workspace import UNKNOWN, Factor, Problem, SearchWork
from poise.hqp._measure import measure_values
from poise.hqp._tolerances import DEPENDENCE_TOLERANCE, OPTIMALITY_TOLERANCE


@part
def find_moved(problem: Problem, work: SearchWork) -> int:
    """Return the first level whose residual changed after it was solved, or -1."""
    rows, factor, answer = work.rows, work.factor, work.answer
    if work.state.unsettled == 0:
        return -1
    lower, upper, weights = problem.lower, problem.upper, problem.weights
    values, level_of = work.points.values, rows.level
    measure_values(lower, upper, weights, level_of, values, answer.slacks, answer.residuals)
    sizes, reach = answer.target_residuals, _reach(problem, factor)
    sizes[:] = 0.0
    for i in range(len(weights)):
        sizes[rows.level[i]] = max(sizes[rows.level[i]], rows.norm[i] * weights[i])
    for level in range(len(sizes)):
        square = 0.0
        for place in range(factor.begin[level], factor.begin[level + 1]):
            index = factor.order[place]
            slack = factor.slack[place] + rows.shift[index] * weights[index]
            square += slack * slack
        room = OPTIMALITY_TOLERANCE * sizes[level] * reach
        if not abs(answer.residuals[level] - sqrt(square)) <= room:
            return level
    return -1


@part
def guard(problem: Problem, work: SearchWork, level: int) -> bool:
    """Keep the remainder of a level's dependent rows, where it moved, from the levels below."""
    rows, factor, values = work.rows, work.factor, work.points.values
    reach, found = _reach(problem, factor), False
    for place in range(factor.begin[level] + factor.rank[level], factor.begin[level + 1]):
        index = factor.order[place]
        moved = values[index] * problem.weights[index] - factor.bound[place] - factor.slack[place]
        room = OPTIMALITY_TOLERANCE * factor.size[place] * reach
        if rows.guarded[index] == 0 and abs(moved) > room:
            rows.guarded[index], rows.factored[index] = 1, UNKNOWN
            found = True
    return found


@part
def hangs_on_rank(problem: Problem, work: SearchWork) -> bool:
    """Return whether a level would miss less if a nearly dependent row were independent.

    With equalities alone the same rows count as dependent however many levels follow. Inequalities
    that are active for a level below may take the remainder of a row, or leave more of it.
    """
    factor, level_of = work.factor, work.rows.level
    least = DEPENDENCE_TOLERANCE * DEPENDENCE_TOLERANCE
    for level in range(len(factor.rank)):
        for place in range(factor.begin[level] + factor.rank[level], factor.begin[level + 1]):
            if not factor.left[place] > least:
                continue
            room = OPTIMALITY_TOLERANCE * factor.size[place] * _reach(problem, factor)
            if abs(factor.slack[place]) > room:
                for i in range(len(level_of)):
                    bounded = problem.lower[i] > -np.inf or problem.upper[i] < np.inf
                    if level_of[i] <= level and bounded and problem.lower[i] < problem.upper[i]:
                        return True
    return False


@part
def _reach(problem: Problem, factor: Factor) -> float:
    """Return the largest distance that one active row, or the final cost, alone takes x."""
    slope = curvature = 0.0
    for i in range(len(problem.g)):
        slope, curvature = max(slope, abs(problem.g[i])), max(curvature, abs(problem.H[i, i]))
    return max(natural_reach(factor), slope / curvature if curvature > 0.0 else 0.0)
