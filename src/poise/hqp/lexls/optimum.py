"""The lexicographic optimum of an active set: its rows are equalities, all others are left out."""

from poise._compiled import part
from poise.hqp.lexls.factor import factor_level
from poise.hqp.lexls.final_cost import solve_cost
from poise.hqp.lexls.least_squares import share_slack
from poise.hqp.lexls.reflections import copy, length_of, reflect
from poise.hqp.lexls.tolerances import SLACK_TOLERANCE
from poise.hqp.lexls.workspace import CHANGES, FREE, Problem, Work

FIRM = 8
"""What tells the code of a firm row's side from another's."""


@part
def find_optimum(problem: Problem, work: Work) -> None:
    """Factors the active rows and finds their optimum.

    Args:
        problem: the problem.
        work: receives the optimum as its `target`.
    """
    n, levels = len(work.x), len(work.rank)
    start = _first_changed(problem, work)
    work.begin[0] = work.first[0] = 0
    for level in range(start, levels):
        factor_level(problem, work, level)
        solve_level(work, level)
    taken = work.first[levels]
    work.state[FREE] = n - taken
    work.y[taken:] = 0.0
    copy(work.target, work.y)
    for k in range(taken - 1, -1, -1):
        reflect(work.target[k:], work.V[k, k:], work.tau[k])
    if taken < n:
        solve_cost(problem, work, taken)


@part
def _first_changed(problem: Problem, work: Work) -> int:
    """The first level whose active rows are not as they were factored, and notes how they are.

    What was found for the levels above it stays as it is.
    """
    n, first = len(work.x), len(work.rank)
    for level in range(len(work.rank)):
        if level == problem.bounds_level and _note(work, 0, n):
            first = min(first, level)
        if _note(work, n + problem.starts[level], n + problem.starts[level + 1]):
            first = min(first, level)
    # A new problem has new numbers everywhere.
    return 0 if work.state[CHANGES] == 1 else first


@part
def _note(work: Work, begin: int, end: int) -> bool:
    """Notes sides and firmness of rows; returns whether they were others."""
    changed = False
    for i in range(begin, end):
        now = 0 if work.side[i] == 0 else work.side[i] + FIRM * work.firm[i]
        if work.factored[i] != now:
            work.factored[i], changed = now, True
    return changed


@part
def solve_level(work: Work, level: int) -> None:
    """Gives a level the least slack that is left to it.

    Args:
        work: in which the level is factored, and those above it are solved.
        level: which.
    """
    begin, end = work.begin[level], work.begin[level + 1]
    first, rank = work.first[level], work.rank[level]
    y, rest, slack = work.y, work.rest, work.slack
    above, z = y[:first], y[first : first + rank]
    for row in range(begin, end):
        head, left = work.R[row], work.bound[row]
        for j in range(first):
            left -= head[j] * above[j]
        rest[row] = left
        slack[row] = 0.0
    _solve_pivots(work, begin, first, rank)
    size, met = length_of(y[: first + rank]), True
    for row in range(begin + rank, end):
        own, left = work.R[row, first : first + rank], rest[row]
        for j in range(rank):
            left -= own[j] * z[j]
        if abs(left) > SLACK_TOLERANCE * (abs(work.bound[row]) + work.size[row] * size):
            slack[row], met = -left, False
    if met:
        return
    if rank > 0:
        share_slack(work, begin, end, first, rank)
        for row in range(begin, begin + rank):
            rest[row] += slack[row]
        _solve_pivots(work, begin, first, rank)


@part
def _solve_pivots(work: Work, begin: int, first: int, rank: int) -> None:
    """Meets a level's pivots, one after the other."""
    z = work.y[first : first + rank]
    for k in range(rank):
        own, left = work.R[begin + k, first : first + rank], work.rest[begin + k]
        for j in range(k):
            left -= own[j] * z[j]
        z[k] = left / own[k]
