"""Damping of levels near singularities: their targets move to where a bounded step reaches.

Damping must not depend on the active set, or the problem would change with every row of the search.
So it regards the equalities alone, one time, before the search begins, and moves their bounds. The
search then solves an ordinary problem.
"""

from math import sqrt

from poise._compiled import part
from poise.hqp._active_set.kernels import add_multiple, copy, minus_dot, norm_of
from poise.hqp._active_set.least_squares import solve_damped
from poise.hqp._active_set.optimum import factor_level, solve_level
from poise.hqp._active_set.workspace import (
    EQUALITY,
    Factor,
    LeastSquares,
    Problem,
    SearchWork,
    Vector,
)
from poise.hqp._tolerances import SINGULAR_ROUNDS, SINGULAR_TOLERANCE


@part
def damp_equalities(problem: Problem, work: SearchWork) -> None:
    """Move the bounds of equalities whose level is nearer to a singularity than its damping."""
    if not norm_of(problem.damping) > 0.0:
        return
    rows, factor, sides = work.rows, work.factor, work.duals.chosen
    for i in range(len(rows.side)):
        sides[i], rows.shift[i] = rows.side[i], 0.0
        if rows.side[i] != EQUALITY:
            rows.side[i] = 0
    factor.begin[0] = factor.first[0] = 0
    for level in range(len(factor.rank)):
        factor_level(problem, rows, factor, level)
        damping, eased = problem.damping[level], 0.0
        if damping > 0.0 and factor.rank[level] > 0:
            least = _least_singular_value(factor, work.squares.v, level)
            # The difference of equal squares may be rounding above zero.
            eased = damping * damping - least * least if least < damping else 0.0
        work.answer.eased[level] = eased
        if eased == 0.0:
            solve_level(factor, work.squares, level)
            continue
        _solve_damped_level(factor, work.squares, level, sqrt(eased))
        for place in range(factor.begin[level], factor.begin[level + 1]):
            index = factor.order[place]
            rows.shift[index] = factor.slack[place] / problem.weights[index]
    for i in range(len(rows.side)):
        rows.side[i] = sides[i]


@part
def _least_singular_value(factor: Factor, room: Vector, level: int) -> float:
    """Find the least singular value of the pivots' triangle L by inverse iteration with L L^T."""
    begin, first, rank = factor.begin[level], factor.first[level], factor.rank[level]
    v, least = room[:rank], 0.0
    for k in range(rank):
        # Hardly orthogonal to the direction of the least singular value.
        v[k] = 1.0 + 0.37 * (k % 3)
    for _ in range(SINGULAR_ROUNDS):
        norm = norm_of(v)
        for k in range(rank):
            own = factor.R[begin + k, first : first + rank]
            v[k] = minus_dot(v[k] / norm, v[:k], own) / own[k]
        for k in range(rank - 1, -1, -1):
            own = factor.R[begin + k, first : first + rank]
            v[k] /= own[k]
            add_multiple(v[:k], -v[k], own)
        before, least = least, 1.0 / sqrt(norm_of(v))
        if abs(least - before) <= SINGULAR_TOLERANCE * least:
            break
    return least


@part
def _solve_damped_level(factor: Factor, squares: LeastSquares, level: int, damping: float) -> None:
    """Find coordinates z and slack of a level with the least |slack|^2 + damping^2 |z|^2."""
    begin, end = factor.begin[level], factor.begin[level + 1]
    first, rank = factor.first[level], factor.rank[level]
    above, z = factor.y[:first], factor.y[first : first + rank]
    for i in range(end - begin):
        row = factor.R[begin + i]
        squares.rhs[i] = minus_dot(factor.bound[begin + i], above, row)
        for j in range(rank):
            squares.T[j, i] = row[first + j]
    copy(factor.rhs[begin:end], squares.rhs)
    solve_damped(squares, end - begin, damping, z)
    for place in range(begin, end):
        own = factor.R[place, first : first + rank]
        factor.slack[place] = -minus_dot(factor.rhs[place], z, own)
