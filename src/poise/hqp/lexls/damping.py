"""Damping of levels near singularities: their targets move to where a bounded step reaches.

What is damped must not depend on the active set, or the search would chase a problem that changes
with every row. So damping looks at the equalities alone, once, before the search begins, and moves
their bounds. What the search then solves is an ordinary problem.
"""

from math import sqrt

from poise._compiled import part
from poise.hqp.lexls.factor import factor_level
from poise.hqp.lexls.least_squares import solve_damped
from poise.hqp.lexls.optimum import solve_level
from poise.hqp.lexls.reflections import length_of
from poise.hqp.lexls.tolerances import SINGULAR_TOLERANCE
from poise.hqp.lexls.workspace import EQUALITY, Problem, Work

_ROUNDS = 30
"""Of the inverse iteration at most."""


@part
def ease(problem: Problem, work: Work) -> None:
    """Moves the bounds of equalities whose level is nearer to a singularity than its damping.

    Args:
        problem: the problem.
        work: whose shift is found; sides are as they were.
    """
    sides = work.chosen
    for i in range(len(work.side)):
        sides[i], work.shift[i] = work.side[i], 0.0
        if work.side[i] != EQUALITY:
            work.side[i] = 0
    work.begin[0] = work.first[0] = 0
    for level in range(len(work.rank)):
        factor_level(problem, work, level)
        work.eased[level] = _lack(problem, work, level)
        if work.eased[level] == 0.0:
            solve_level(work, level)
            continue
        _damp(work, level)
        for place in range(work.begin[level], work.begin[level + 1]):
            index = work.order[place]
            work.shift[index] = work.slack[place] / problem.weights[index]
    for i in range(len(work.side)):
        work.side[i] = sides[i]


@part
def _lack(problem: Problem, work: Work, level: int) -> float:
    """Square of the damping that a level needs: what its least singular value lacks."""
    damping, rank = problem.damping[level], work.rank[level]
    if damping == 0.0 or rank == 0:
        return 0.0
    least = _least_singular_value(work, work.begin[level], work.first[level], rank)
    # Asked because rounding of equal squares may leave something.
    return damping * damping - least * least if least < damping else 0.0


@part
def _least_singular_value(work: Work, begin: int, first: int, rank: int) -> float:
    """Of the pivots' triangle L, by inverse iteration with L L^T."""
    v, least = work.vector[:rank], 0.0
    for k in range(rank):
        # Not likely to have nothing of the direction that is looked for.
        v[k] = 1.0 + 0.37 * (k % 3)
    for _ in range(_ROUNDS):
        length = length_of(v)
        for k in range(rank):
            own, total = work.R[begin + k, first : first + rank], v[k] / length
            for j in range(k):
                total -= own[j] * v[j]
            v[k] = total / own[k]
        for k in range(rank - 1, -1, -1):
            own = work.R[begin + k, first : first + rank]
            v[k] /= own[k]
            for j in range(k):
                v[j] -= own[j] * v[k]
        before, least = least, 1.0 / sqrt(length_of(v))
        if abs(least - before) <= SINGULAR_TOLERANCE * least:
            break
    return least


@part
def _damp(work: Work, level: int) -> None:
    """Gives a level coordinates z and slack: the least |slack|^2 + eased |z|^2."""
    begin, end = work.begin[level], work.begin[level + 1]
    first, rank = work.first[level], work.rank[level]
    above, z = work.y[:first], work.y[first : first + rank]
    for i in range(end - begin):
        row, left = work.R[begin + i], work.bound[begin + i]
        for j in range(first):
            left -= row[j] * above[j]
        work.rest[begin + i] = work.right[i] = left
        for j in range(rank):
            work.T[j, i] = row[first + j]
    solve_damped(work, end - begin, sqrt(work.eased[level]), z)
    for place in range(begin, end):
        own, left = work.R[place, first : first + rank], -work.rest[place]
        for j in range(rank):
            left += own[j] * z[j]
        work.slack[place] = left
