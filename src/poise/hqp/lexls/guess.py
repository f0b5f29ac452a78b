"""A guess of the active set, level by level, by a dual active-set method with penalties.

Every row may be violated at a price: high for the level at hand, and so much higher for those above
that they hardly ever are. Then no row can be impossible, and a step adds one row, which costs as
little as a product of matrix and vector: see `dual.py`. With the final cost's H = C C^T and rows
M_i = C^-1 a_i, the active rows' multipliers solve

    (M M^T + D) lambda = a x_0 - b,    x = x_0 - H^-1 A^T lambda,    a x = b + D lambda,

where x_0 = -H^-1 g and D is what the penalties make of the slack.

Numbers have no room for penalties so high that D lambda can be forgotten. So it is taken back: with
bounds moved by -D lambda the same rows are solved again, as in the method of multipliers (Hestenes
1969, "Multiplier and gradient methods"). If the level at hand can be met, its slack is gone after
that. If not, it stays, and then only the levels above are corrected until they are met; for the
level itself D lambda is what the others leave it.
"""

from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.hqp.lexls.dual import converge, drop_wrong
from poise.hqp.lexls.penalties import factor_rows, get_ready, solve_rest
from poise.hqp.lexls.system import System, cut_system
from poise.hqp.lexls.tolerances import CORRECTIONS, FIRM_SHARE, HARD, MET_SHARE, MET_TOLERANCE, SOFT
from poise.hqp.lexls.workspace import EQUALITY, UNKNOWN, Problem, Work


@part
def guess(problem: Problem, work: Work) -> None:
    """Chooses the sides of all rows anew.

    Args:
        problem: the problem.
        work: whose sides are set; where they were and what they were needed for says with which
            rows each level begins. Everything that a factorisation left is lost.
    """
    system = cut_system(
        work.system,
        problem.lower,
        problem.upper,
        work.goal,
        work.y,
        work.R,
        work.C,
        work.side,
        work.firm,
        work.needed,
        work.order,
    )
    get_ready(problem, work, system)
    n, count, held = len(problem.g), 0, 0
    for level in range(len(work.rank)):
        # Bounds before rows: those of this level end and begin here, and these may enter.
        bounds = n if problem.bounds_level == level else 0
        begin, end = n + problem.starts[level], n + problem.starts[level + 1]
        top = 0 if problem.bounds_level <= level else n
        if not _price(system, problem.weights, bounds, begin, end):
            continue
        for i in range(top, end):
            mine = i < bounds or i >= begin
            count = _add_known(system, i, level, mine, count)
        factor_rows(system, held, count)
        count = converge(system, top, end, drop_wrong(system, count))
        slack = _find_slack(system, problem.weights, bounds, begin, end, count)
        if slack > 0.0:
            count = converge(system, top, end, _correct(system, 0, 0, 0, count))
            if _find_slack(system, problem.weights, bounds, begin, end, count) > MET_SHARE * slack:
                for _ in range(CORRECTIONS):
                    count = _correct(system, bounds, begin, end, count)
                    count = converge(system, top, end, count)
        held = _settle(system, problem.weights, bounds, begin, end, count)
    for i in range(n + len(problem.A)):
        work.factored[i], work.firm[i] = UNKNOWN, 0
        if problem.lower[i] == problem.upper[i]:
            work.side[i], work.firm[i] = EQUALITY, 1


@part
def _price(
    system: System, weights: Float64[np.ndarray, " nm"], bounds: int, begin: int, end: int
) -> bool:
    """Sets D of a level's rows while it is at hand; returns whether it has any."""
    total, rows = 0.0, 0
    for i in range(end):
        if i < bounds or i >= begin:
            size = system.length[i] * weights[i]
            total += size * size
            rows += 1 if size > 0.0 else 0
    if rows == 0:
        return False
    for i in range(end):
        if i < bounds or i >= begin:
            system.price[i] = SOFT * total / (rows * weights[i] * weights[i])
    return True


@part
def _add_known(system: System, index: int, level: int, mine: bool, count: int) -> int:
    """Makes a row active that is the level's equality or was needed by it; returns how many are."""
    side = 0
    if mine and system.lower[index] == system.upper[index]:
        side = EQUALITY
    elif abs(system.needed[index]) == level + 1:
        side = 1 if system.needed[index] > 0 else -1
    room = count < len(system.G) and system.side[index] == 0 and system.length[index] > 0.0
    if side == 0 or not room:
        return count
    system.side[index], system.firm[index] = side, 1 if side == EQUALITY else 0
    system.order[count] = index
    return count + 1


@part
def _find_slack(
    system: System,
    weights: Float64[np.ndarray, " nm"],
    bounds: int,
    begin: int,
    end: int,
    count: int,
) -> float:
    """What a level's active rows miss, weighted; zero where that is next to nothing."""
    square = size = reach = 0.0
    for j in range(len(system.y)):
        reach += system.y[j] * system.y[j]
    for k in range(count):
        i = system.order[k]
        if i < bounds or begin <= i < end:
            missed = _missed(system, k) * weights[i]
            square += missed * missed
            size = max(size, system.length[i] * weights[i])
    slack = sqrt(square)
    return slack if slack > MET_TOLERANCE * size * sqrt(reach) else 0.0


@part
def _missed(system: System, place: int) -> float:
    """How far an active row is from its bound."""
    i = system.order[place]
    return float(system.gap[i] + system.price[i] * system.push[place])


@part
def _correct(system: System, bounds: int, begin: int, end: int, count: int) -> int:
    """Moves bounds by what rows give way, but not those named; returns how many rows are active."""
    for k in range(count):
        i = system.order[k]
        system.gap[i] = system.settled[i]
        if not (i < bounds or begin <= i < end):
            system.gap[i] -= system.price[i] * system.push[k]
    solve_rest(system, count)
    return drop_wrong(system, count)


@part
def _settle(
    system: System,
    weights: Float64[np.ndarray, " nm"],
    bounds: int,
    begin: int,
    end: int,
    count: int,
) -> int:
    """Holds what a level reached; returns the first place whose price is another now.

    Where a level has slack, its rows and those in its way stay active.
    """
    slack, most = _find_slack(system, weights, bounds, begin, end, count), 0.0
    for k in range(count):
        i = system.order[k]
        if slack > 0.0 and (i < bounds or begin <= i < end):
            most = max(most, abs(system.push[k]) * system.length[i])
    for k in range(count):
        i = system.order[k]
        if slack > 0.0 and abs(system.push[k]) * system.length[i] > FIRM_SHARE * most:
            system.firm[i] = 1
        if slack > 0.0 and (i < bounds or begin <= i < end):
            system.settled[i] = _missed(system, k)
            if abs(system.settled[i]) * weights[i] > FIRM_SHARE * slack:
                system.firm[i] = 1
    for i in range(end):
        if i < bounds or i >= begin:
            system.price[i] = HARD * system.length[i] * system.length[i]
    first = count
    for k in range(count - 1, -1, -1):
        i = system.order[k]
        system.gap[i] = system.settled[i] - system.price[i] * system.push[k]
        if i < bounds or begin <= i < end:
            first = k
    return first
