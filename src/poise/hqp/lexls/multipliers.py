"""Multipliers at the optimum of an active set, level by level, and what they say about it."""

from math import sqrt

import numpy as np

from poise._compiled import part
from poise.hqp.lexls.final_cost import find_gradient
from poise.hqp.lexls.reflections import copy, length_of, reflect
from poise.hqp.lexls.tolerances import DUAL_TOLERANCE, FEASIBILITY_TOLERANCE
from poise.hqp.lexls.workspace import DOUBT, EQUALITY, RELEASED, Problem, Work

STRONGEST, FIRST = 2.0, 3.0
"""What `release` takes instead of a share, to let go of one row: which."""


@part
def release(problem: Problem, work: Work, share: float) -> int:
    """Finds multipliers at the optimum of the active set, and lets go of what pulls there.

    A level's slack is its own multiplier, and the levels above hold against it. Of a row's
    multipliers, highest level first, the first that is not zero must push; the others are free.

    Args:
        problem: the problem.
        work: whose target is the optimum of its active set.
        share: rows that pull at least this share of the strongest pull are let go, or
            `STRONGEST`, or `FIRST`.

    Returns:
        How many rows were let go.
    """
    levels = len(work.rank)
    work.state[RELEASED], work.state[DOUBT] = -1, 0
    active = work.begin[levels]
    for place in range(active):
        index = work.order[place]
        work.firm[index] = 1 if work.side[index] == EQUALITY else 0
        work.needed[index] = 0
    work.multipliers[:] = 0.0
    for level in range(levels + 1):
        found = work.multipliers[level]
        if level < levels:
            size = _own_push(problem, work, level, found)
            if size < 0.0:
                return int(-size)
            if size == 0.0:
                continue
            above = work.begin[level]
        else:
            size = _cost_push(problem, work)
            above = active
        _balance(work, level, found)
        count = _check_pushes(work, level, above, size, share)
        if count > 0:
            return count
        if level < levels:
            for place in range(work.begin[level], work.begin[level + 1]):
                if _is_clear(work, place, size):
                    work.firm[work.order[place]] = 1
    for level in range(levels + 1):
        for place in range(active):
            index = work.order[place]
            work.multipliers[level, index] *= problem.weights[index]
    return 0


@part
def _is_clear(work: Work, place: int, size: float) -> bool:
    """Whether a row's own slack is more than rounding, by what it pushes or in its own unit."""
    slack = abs(work.slack[place])
    own = abs(work.bound[place]) + work.size[place] * length_of(work.target)
    return slack * work.size[place] > DUAL_TOLERANCE * size or slack > DUAL_TOLERANCE * own


@part
def _own_push(problem: Problem, work: Work, level: int, found: np.ndarray) -> float:
    """A level's slack and the force it makes; returns its size, or minus how many rows let go."""
    begin, end, first = work.begin[level], work.begin[level + 1], work.first[level]
    square, wrong = 0.0, 0
    for place in range(begin, end):
        slack = work.slack[place]
        if slack == 0.0:
            continue
        index = work.order[place]
        found[index] = slack
        square += slack * slack * work.size[place] * work.size[place]
        side = work.side[index]
        if side != EQUALITY and slack * side < 0.0:
            wrong += 1
            _let_go(problem, work, index)
        elif work.firm[index] == 0:
            work.needed[index] = 1 + level
    if wrong > 0:
        return -float(wrong)
    if square == 0.0:
        return 0.0
    force = work.force[:first]
    force[:] = 0.0
    for place in range(begin, end):
        slack = work.slack[place]
        if slack != 0.0:
            row = work.R[place]
            for j in range(first):
                force[j] += slack * row[j]
    return sqrt(square)


@part
def _let_go(problem: Problem, work: Work, index: int) -> None:
    """Makes a row inactive whose slack has the wrong sign, unless it has gone right through."""
    value = work.goal[index]
    room = FEASIBILITY_TOLERANCE * work.norms[index] * length_of(work.target)
    side = 0
    if value > problem.upper[index] + room:
        side = 1
    elif value < problem.lower[index] - room:
        side = -1
    work.side[index] = side
    work.firm[index] = 0


@part
def _cost_push(problem: Problem, work: Work) -> float:
    """The final cost's force in y; returns the size of what cancels in it."""
    taken = work.first[len(work.rank)]
    find_gradient(problem, work.target, work.hx)
    size = 0.0
    for i in range(len(work.hx)):
        # Not what is left of H x: that is rounding where x lies in the kernel of H.
        row, terms = problem.H[i], abs(problem.g[i])
        for j in range(len(work.hx)):
            terms += abs(row[j] * work.target[j])
        size = max(size, terms)
    copy(work.force, work.hx)
    for k in range(taken):
        reflect(work.force[k:], work.V[k, k:], work.tau[k])
    return size


@part
def _balance(work: Work, level: int, found: np.ndarray) -> None:
    """Multipliers of the levels above that balance the force; only pivots push."""
    force = work.force
    for upper in range(level - 1, -1, -1):
        begin, first = work.begin[upper], work.first[upper]
        for k in range(work.rank[upper] - 1, -1, -1):
            column = first + k
            if force[column] == 0.0:
                continue
            row = work.R[begin + k]
            push = -force[column] / row[column]
            found[work.order[begin + k]] = push
            for j in range(column):
                force[j] += push * row[j]


@part
def _check_pushes(work: Work, level: int, above: int, size: float, share: float) -> int:
    """Lets go of rows above a level that pull; returns how many."""
    found = work.multipliers[level]
    for place in range(above):
        size = max(size, abs(found[work.order[place]]) * work.size[place])
    noise = DUAL_TOLERANCE * size
    count, first, strongest, most = 0, -1, -1, 0.0
    for place in range(above):
        index = work.order[place]
        push = found[index] * work.size[place] * work.side[index]
        if work.firm[index] == 0 and push > noise:
            work.needed[index] = 1 + min(level, len(work.rank) - 1)
        if work.firm[index] != 0 or not push < -noise:
            continue
        if work.locked[index] != 0:
            work.state[DOUBT] = 1
            continue
        work.chosen[count], work.rest[count] = index, push
        count += 1
        if push < most:
            strongest, most = index, push
        if first < 0 or index < first:
            first = index
    if count > 0:
        if share > 1.0:
            work.state[RELEASED] = first if share == FIRST else strongest
            work.side[work.state[RELEASED]] = 0
            return 1
        gone = 0
        for i in range(count):
            if work.rest[i] <= share * most:
                work.side[work.chosen[i]] = work.firm[work.chosen[i]] = 0
                gone += 1
        return gone
    for place in range(above):
        index = work.order[place]
        if abs(found[index]) * work.size[place] > noise:
            work.firm[index] = 1
    return 0
