"""Exchanges of one row after the other, and leaps of many rows at once, from set to set.

Both look at the optimum of the active set alone, not at a point on the way. An exchange lets go of
what pulls before anything else is made active, one row at a time, as dual methods do: where a tick
violates a row or two, it mostly ends within three. A leap lets rows go that pull and makes rows
active that are violated, all at once, as in block pivoting (Portugal, Judice, Vicente 1994, "A
comparison of block pivoting and interior-point algorithms for linear least squares problems with
nonnegative variables"). Nothing says that either leads nearer. But where nothing pulls and nothing
is violated is the optimum, and mostly they get there in fewer factorisations than single steps.
"""

import numpy as np

from poise._compiled import part
from poise.hqp.lexls.measure import is_better
from poise.hqp.lexls.multipliers import STRONGEST, release
from poise.hqp.lexls.reflections import copy, length_of
from poise.hqp.lexls.tolerances import (
    ADD_SHARES,
    DROP_SHARES,
    FEASIBILITY_TOLERANCE,
    LEAP_PATIENCE,
    MOST_EXCHANGES,
    MOST_LEAPS,
)
from poise.hqp.lexls.workspace import EQUALITY, FEWEST, LEAPS, PHASE, SINCE, STEPPING, Problem, Work


@part
def leap(problem: Problem, work: Work) -> bool:
    """Changes the active set; returns whether its optimum is that of the problem.

    Args:
        problem: the problem.
        work: whose target is the optimum of its active set; its point becomes the better of both.
    """
    state = work.state
    turn = state[LEAPS]
    state[LEAPS] += 1
    largest = find_violations(problem, work, work.target, work.goal)
    wrong = count_violations(work) + release(problem, work, DROP_SHARES[turn % len(DROP_SHARES)])
    if wrong == 0:
        copy(work.x, work.target)
        copy(work.values, work.goal)
        return True
    if is_better(problem, work):
        copy(work.x, work.target)
        copy(work.values, work.goal)
    state[SINCE] += 1
    if wrong < state[FEWEST]:
        state[FEWEST], state[SINCE] = wrong, 0
    if turn + 1 < MOST_LEAPS and state[SINCE] < LEAP_PATIENCE:
        if largest > 0.0:
            activate(work, ADD_SHARES[turn % len(ADD_SHARES)] * largest)
    else:
        state[PHASE] = STEPPING
        begin_steps(problem, work)
    return False


@part
def exchange(problem: Problem, work: Work) -> bool:
    """Lets the row go that pulls most, or else makes the one active that is violated most."""
    state = work.state
    largest = find_violations(problem, work, work.target, work.goal)
    pulling = release(problem, work, STRONGEST)
    optimal = largest == 0.0 and pulling == 0
    if optimal or is_better(problem, work):
        copy(work.x, work.target)
        copy(work.values, work.goal)
    if optimal:
        return True
    state[LEAPS] += 1
    if state[LEAPS] == MOST_EXCHANGES:
        state[PHASE] = STEPPING
        begin_steps(problem, work)
    elif pulling == 0:
        activate(work, largest)
    return False


@part
def begin_steps(problem: Problem, work: Work) -> None:
    """Makes active what the point violates, and nothing that it keeps away from."""
    size = FEASIBILITY_TOLERANCE * length_of(work.x)
    for i in range(len(work.values)):
        value, room = work.values[i], size * work.norms[i]
        if work.side[i] != EQUALITY and (problem.lower[i] + room < value < problem.upper[i] - room):
            work.side[i] = work.firm[i] = 0
    if find_violations(problem, work, work.x, work.values) > 0.0:
        activate(work, 0.0)


@part
def find_violations(problem: Problem, work: Work, x: np.ndarray, values: np.ndarray) -> float:
    """How far, signed, a point violates each inactive row, relative to its size.

    Args:
        problem: the problem.
        work: whose slacks receive it.
        x: the point.
        values: of all bounds and rows there.

    Returns:
        The largest.
    """
    size, largest = FEASIBILITY_TOLERANCE * length_of(x), 0.0
    for i in range(len(values)):
        work.slacks[i] = 0.0
        if work.side[i] != 0:
            continue
        over = max(values[i] - problem.upper[i], problem.lower[i] - values[i])
        if over > size * work.norms[i]:
            far = over / work.norms[i] if work.norms[i] > 0.0 else over
            work.slacks[i] = far if values[i] > problem.upper[i] else -far
            largest = max(largest, far)
    return largest


@part
def count_violations(work: Work) -> int:
    """How many rows `find_violations` found."""
    count = 0
    for i in range(len(work.slacks)):
        count += 1 if work.slacks[i] != 0.0 else 0
    return count


@part
def activate(work: Work, least: float) -> None:
    """Makes rows active that are violated by at least so much.

    Args:
        work: in which `find_violations` looked for them.
        least: how much.
    """
    for i in range(len(work.slacks)):
        far = work.slacks[i]
        if far != 0.0 and abs(far) >= least:
            work.side[i] = 1 if far > 0.0 else -1
            work.firm[i] = 0
