"""A guess of the active set, from none: level by level, by a dual active-set method with penalties.

Every row may be violated at a price: high for the level at hand, and so much higher for those above
that they hardly ever are. Then no row can be impossible, each step adds the row that is violated
most (Goldfarb, Idnani 1983, "A numerically stable dual method for solving strictly convex quadratic
programs"), and costs as little as a product of matrix and vector. Penalties and exact rows differ
in the last digits of x, and seldom in the active set: where the search begins with this one, it
mostly ends there.

With the final cost's H = C C^T and rows M_i = C^-1 a_i, the active rows' multipliers solve

    (M M^T + D) lambda = a x_0 - b,    x = x_0 - H^-1 A^T lambda,    a x = b + D lambda,

where x_0 = -H^-1 g and D is what the penalties make of the slack.
"""

from math import sqrt

from poise.hqp.lexls.penalties import (
    add_row,
    factor_rows,
    find_lambda,
    find_point,
    get_ready,
    remove_row,
)
from poise.hqp.lexls.tolerances import (
    FIRM_SHARE,
    GUESS_TOLERANCE,
    HARD,
    MET_TOLERANCE,
    SOFT,
)
from poise.hqp.lexls.workspace import EQUALITY, UNKNOWN, Problem, Work
from poise.linalg import part


@part
def guess(problem: Problem, work: Work) -> None:
    """Chooses the sides of all rows anew.

    Args:
        problem: the problem.
        work: whose sides are set; everything that a factorisation left is lost.
    """
    n = len(work.x)
    get_ready(problem, work)
    count, left = 0, 2 * len(work.side)
    for level in range(len(work.rank)):
        unit = _price(problem, work, level, SOFT, 0.0)
        if unit == 0.0:
            continue
        count = _add_equalities(problem, work, level, count)
        factor_rows(problem, work, count)
        find_lambda(work, count, work.left)
        count = _drop_wrong(work, count)
        while left >= 0:
            left -= 1
            find_point(problem, work, count)
            index = _most_violated(problem, work, level)
            if index < 0 or count == len(work.G):
                break
            count = _enter(problem, work, index, count)
        _settle(problem, work, level, count)
        _price(problem, work, level, HARD, unit)
    for i in range(n + len(problem.A)):
        work.factored[i] = UNKNOWN
        if problem.lower[i] == problem.upper[i]:
            work.side[i] = EQUALITY


@part
def _ends(problem: Problem, level: int) -> tuple[int, int, int]:
    """Where a level's bounds end, and where its rows begin and end, among bounds and rows."""
    n = len(problem.g)
    bounds = n if problem.bounds_level == level else 0
    return bounds, n + problem.starts[level], n + problem.starts[level + 1]


@part
def _price(problem: Problem, work: Work, level: int, share: float, unit: float) -> float:
    """Sets D of a level's rows, to a share of what is usual there; returns that, or what it was."""
    bounds, begin, end = _ends(problem, level)
    if unit == 0.0:
        total, rows = 0.0, 0
        for i in range(end):
            if i < bounds or i >= begin:
                size = work.size[i] * problem.weights[i]
                total += size * size
                rows += 1 if size > 0.0 else 0
        unit = total / rows if rows > 0 else 0.0
    for i in range(end):
        if i < bounds or i >= begin:
            work.kept[i] = share * unit / (problem.weights[i] * problem.weights[i])
    return unit


@part
def _add_equalities(problem: Problem, work: Work, level: int, count: int) -> int:
    """Makes a level's equalities active, as far as there is room."""
    bounds, begin, end = _ends(problem, level)
    for i in range(end):
        mine = i < bounds or i >= begin
        if not mine or problem.lower[i] != problem.upper[i] or work.size[i] == 0.0:
            continue
        if count < len(work.G):
            work.side[i], work.firm[i] = EQUALITY, 1
            work.order[count] = i
            count += 1
    return count


@part
def _most_violated(problem: Problem, work: Work, level: int) -> int:
    """The inactive row, down to a level, that is violated most, relative to its size; or -1."""
    n, worst = len(work.x), -1
    most = 0.0
    for j in range(n):
        most += work.y[j] * work.y[j]
    most = GUESS_TOLERANCE * sqrt(most)
    for i in range(n + problem.starts[level + 1]):
        if work.side[i] != 0 or not work.size[i] > 0.0:
            continue
        if i < n and problem.bounds_level > level:
            continue
        over = max(work.goal[i] - problem.upper[i], problem.lower[i] - work.goal[i])
        if over > most * work.size[i]:
            worst, most = i, over / work.size[i]
    return worst


@part
def _enter(problem: Problem, work: Work, index: int, count: int) -> int:
    """Makes a violated row active, and lets go of those whose multipliers turn on the way."""
    work.side[index] = 1 if work.goal[index] > problem.upper[index] else -1
    work.order[count] = index
    work.left[count] = 0.0
    add_row(problem, work, count)
    count += 1
    while True:
        find_lambda(work, count, work.bound)
        length, drop = 1.0, -1
        for k in range(count):
            row, now, new = work.order[k], work.left[k], work.bound[k]
            if work.firm[row] != 0 or row == index or not new * work.side[row] < 0.0:
                continue
            share = now / (now - new)
            if share < length:
                length, drop = share, k
        for k in range(count):
            work.left[k] += length * (work.bound[k] - work.left[k])
        if drop < 0:
            return count
        count = _drop(work, drop, count)


@part
def _drop(work: Work, place: int, count: int) -> int:
    """Lets go of a row; returns how many are left."""
    work.side[work.order[place]] = 0
    remove_row(work, place, count)
    return count - 1


@part
def _drop_wrong(work: Work, count: int) -> int:
    """Lets go of rows whose multipliers have the wrong sign, until none has."""
    wrong = True
    while wrong:
        wrong = False
        for k in range(count - 1, -1, -1):
            row = work.order[k]
            if work.firm[row] == 0 and work.left[k] * work.side[row] < 0.0:
                count, wrong = _drop(work, k, count), True
        find_lambda(work, count, work.left)
    return count


@part
def _settle(problem: Problem, work: Work, level: int, count: int) -> None:
    """Holds what a level reached: where it has slack, its rows and those in its way stay active."""
    bounds, begin, end = _ends(problem, level)
    slack = reach = push = size = 0.0
    for j in range(len(work.x)):
        reach += work.y[j] * work.y[j]
    for k in range(count):
        i = work.order[k]
        if i < bounds or begin <= i < end:
            given = work.kept[i] * work.left[k] * problem.weights[i]
            slack += given * given
            push = max(push, abs(work.left[k]) * work.size[i])
            size = max(size, work.size[i] * problem.weights[i])
    slack = sqrt(slack)
    if not slack > MET_TOLERANCE * size * sqrt(reach):
        return
    for k in range(count):
        i = work.order[k]
        given = work.kept[i] * work.left[k]
        mine = i < bounds or begin <= i < end
        if abs(work.left[k]) * work.size[i] > FIRM_SHARE * push:
            work.firm[i] = 1
        if mine:
            if abs(given) * problem.weights[i] > FIRM_SHARE * slack:
                work.firm[i] = 1
            work.slack[i] += given
