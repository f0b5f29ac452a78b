"""Damping of levels near singularities: their targets move to where a bounded step reaches.

What is damped must not depend on the active set, or the search would chase a problem that changes
with every row. So damping looks at the equalities alone, once, before the search begins, and moves
their bounds. What the search then solves is an ordinary problem.
"""

from math import sqrt

from poise._compiled import part
from poise.hqp._active_set.kernels import norm_of
from poise.hqp._active_set.least_squares import solve_damped
from poise.hqp._active_set.optimum import factor_level, solve_level
from poise.hqp._active_set.workspace import EQUALITY, Factor, LeastSquares, Problem, Vector, Work
from poise.hqp._tolerances import SINGULAR_ROUNDS, SINGULAR_TOLERANCE


@part
def damp_equalities(problem: Problem, work: Work) -> None:
    """Moves the bounds of equalities whose level is nearer to a singularity than its damping."""
    rows, factor, sides = work.rows, work.factor, work.duals.chosen
    for i in range(len(rows.side)):
        sides[i], rows.shift[i] = rows.side[i], 0.0
        if rows.side[i] != EQUALITY:
            rows.side[i] = 0
    factor.begin[0] = factor.first[0] = 0
    for level in range(len(factor.rank)):
        factor_level(problem, rows, factor, level)
        eased = _missing_square(problem.damping[level], factor, work.squares.v, level)
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
def _missing_square(damping: float, factor: Factor, room: Vector, level: int) -> float:
    """Square of the damping that a level needs: what its least singular value lacks."""
    if damping == 0.0 or factor.rank[level] == 0:
        return 0.0
    least = _least_singular_value(factor, room, level)
    # Asked because rounding of equal squares may leave something.
    return damping * damping - least * least if least < damping else 0.0


@part
def _least_singular_value(factor: Factor, room: Vector, level: int) -> float:
    """Of the pivots' triangle L, by inverse iteration with L L^T."""
    begin, first, rank = factor.begin[level], factor.first[level], factor.rank[level]
    v, least = room[:rank], 0.0
    for k in range(rank):
        # Not likely to have nothing of the direction that is looked for.
        v[k] = 1.0 + 0.37 * (k % 3)
    for _ in range(SINGULAR_ROUNDS):
        norm = norm_of(v)
        for k in range(rank):
            own, total = factor.R[begin + k, first : first + rank], v[k] / norm
            for j in range(k):
                total -= own[j] * v[j]
            v[k] = total / own[k]
        for k in range(rank - 1, -1, -1):
            own = factor.R[begin + k, first : first + rank]
            v[k] /= own[k]
            for j in range(k):
                v[j] -= own[j] * v[k]
        before, least = least, 1.0 / sqrt(norm_of(v))
        if abs(least - before) <= SINGULAR_TOLERANCE * least:
            break
    return least


@part
def _solve_damped_level(factor: Factor, squares: LeastSquares, level: int, damping: float) -> None:
    """Gives a level coordinates z and slack: the least |slack|^2 + damping^2 |z|^2."""
    begin, end = factor.begin[level], factor.begin[level + 1]
    first, rank = factor.first[level], factor.rank[level]
    above, z = factor.y[:first], factor.y[first : first + rank]
    for i in range(end - begin):
        row, left = factor.R[begin + i], factor.bound[begin + i]
        for j in range(first):
            left -= row[j] * above[j]
        factor.rhs[begin + i] = squares.rhs[i] = left
        for j in range(rank):
            squares.T[j, i] = row[first + j]
    solve_damped(squares, end - begin, damping, z)
    for place in range(begin, end):
        own, left = factor.R[place, first : first + rank], -factor.rhs[place]
        for j in range(rank):
            left += own[j] * z[j]
        factor.slack[place] = left
