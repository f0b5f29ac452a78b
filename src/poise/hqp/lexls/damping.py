"""Damping of a level near a singularity: its coordinates stay bounded, those above untouched."""

from math import sqrt

from poise.hqp.lexls.least_squares import solve_damped
from poise.hqp.lexls.reflections import length_of
from poise.hqp.lexls.tolerances import SINGULAR_TOLERANCE, SLACK_TOLERANCE
from poise.hqp.lexls.workspace import Problem, Work
from poise.linalg import compiled

_ROUNDS = 30
"""Of the inverse iteration at most; two or three are enough near a singularity."""


@compiled
def find_easing(problem: Problem, work: Work, level: int) -> float:
    """Square of the damping that a level needs: what its least singular value lacks.

    Args:
        problem: the problem.
        work: in which the level is factored.
        level: which.
    """
    damping, rank = problem.damping[level], work.rank[level]
    if damping == 0.0 or rank == 0:
        return 0.0
    least = _least_singular_value(work, work.begin[level], work.first[level], rank)
    # Asked because rounding of equal squares may leave something.
    return damping * damping - least * least if least < damping else 0.0


@compiled
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


@compiled
def damp(work: Work, begin: int, end: int, first: int, rank: int, square: float) -> None:
    """Lets a level use its coordinates z no more than worth it: |R z - rest|^2 + square |z|^2.

    Args:
        work: whose y and slack are found.
        begin: the level's first row.
        end: where its rows end.
        first: its first coordinate.
        rank: how many it has.
        square: square of the damping.
    """
    z, count = work.y[first : first + rank], end - begin
    for i in range(count):
        own = work.R[begin + i, first : first + rank]
        for j in range(rank):
            work.T[j, i] = own[j]
        work.right[i] = work.rest[begin + i]
    solve_damped(work, count, sqrt(square), z)
    for row in range(begin, end):
        own, left = work.R[row, first : first + rank], -work.rest[row]
        size = abs(left)
        for j in range(rank):
            left += own[j] * z[j]
            size += abs(own[j] * z[j])
        work.slack[row] = left if abs(left) > SLACK_TOLERANCE * size else 0.0
