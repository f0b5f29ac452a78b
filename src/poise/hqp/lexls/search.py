"""The search for the active set, compiled: `reference.py` with loops written out."""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled, part
from poise.hqp.lexls.damping import ease
from poise.hqp.lexls.guess import guess
from poise.hqp.lexls.leaps import activate, count_violations, exchange, find_violations, leap
from poise.hqp.lexls.measure import check, find_values, is_better, is_sound, measure
from poise.hqp.lexls.multipliers import FIRST, STRONGEST, release
from poise.hqp.lexls.optimum import find_optimum
from poise.hqp.lexls.reflections import copy, length_of
from poise.hqp.lexls.tolerances import (
    ADD_SHARES,
    ASTRAY,
    COLD_CHANGES,
    FEASIBILITY_TOLERANCE,
    MANY,
    MOVE_TOLERANCE,
    PATIENCE,
    WARM_CHANGES,
)
from poise.hqp.lexls.workspace import (
    BEGINNING,
    BEGUN,
    BLOCKED,
    CHANGES,
    ENOUGH,
    EQUALITY,
    EXCHANGING,
    FEWEST,
    GUESS,
    IDLE,
    LAST,
    LEAPING,
    LEAPS,
    NONE,
    ORIGIN,
    PHASE,
    RELEASED,
    SINCE,
    STEPPING,
    Problem,
    Work,
    cut,
)

CONVERGED, DOUBTFUL, UNFINISHED, UNSOUND, LOST = range(5)
"""How a call ended: at an optimum, at what may be none, at the cap, with numbers that cannot be a
problem, with an answer that is no number."""


@compiled
def search(
    A: Float64[np.ndarray, "m n"],
    lower: Float64[np.ndarray, " nm"],
    upper: Float64[np.ndarray, " nm"],
    weights: Float64[np.ndarray, " nm"],
    H: Float64[np.ndarray, "n n"],
    g: Float64[np.ndarray, " n"],
    damping: Float64[np.ndarray, " p"],
    starts: Int64[np.ndarray, " p1"],
    bounds_level: int,
    floats: Float64[np.ndarray, " f"],
    ints: Int64[np.ndarray, " i"],
    changes: int,
) -> int:
    """Searches from the active set in the workspace, or goes on where the last call ended.

    Args:
        A: see `Problem`.
        lower: likewise.
        upper: likewise.
        weights: likewise.
        H: likewise.
        g: likewise.
        damping: likewise.
        starts: likewise.
        bounds_level: likewise.
        floats: see `cut`; receives the answer.
        ints: likewise.
        changes: of the active set, all calls together, after which to stop.

    Returns:
        `CONVERGED` or one of those below it.
    """
    m, n = A.shape
    problem = Problem(A, lower, upper, weights, H, g, damping, starts, bounds_level)
    work = cut(floats, ints, n, m, len(starts) - 1)
    state = work.state
    if state[BEGUN] == 0:
        known = _prepare(problem, work)
        if known < 0:
            return UNSOUND
        if np.any(damping):
            ease(problem, work)
        for place in range(len(state)):
            state[place] = 0
        work.multipliers[:] = 0.0
        state[BEGUN], state[RELEASED] = 1, -1
        state[PHASE] = BEGINNING
        state[ENOUGH] = WARM_CHANGES if known > 0 else COLD_CHANGES
    found = UNFINISHED
    while state[CHANGES] < changes:
        state[CHANGES] += 1
        find_optimum(problem, work)
        find_values(problem, work.target, work.goal)
        if state[PHASE] == BEGINNING:
            optimal = _begin(problem, work)
        elif state[PHASE] == LEAPING:
            optimal = leap(problem, work)
        elif state[PHASE] == EXCHANGING:
            optimal = exchange(problem, work)
        else:
            optimal = _step(problem, work)
        if optimal:
            check(problem, work)
            found = CONVERGED if is_sound(work) else DOUBTFUL
            if found == CONVERGED or state[ORIGIN] == NONE:
                break
        if state[ORIGIN] == LAST and (optimal or state[CHANGES] == state[ENOUGH]):
            guess(problem, work)
            state[ORIGIN] = GUESS
        elif state[ORIGIN] == GUESS and (optimal or state[CHANGES] >= ASTRAY):
            for i in range(len(work.side)):
                work.side[i] = EQUALITY if work.side[i] == EQUALITY else 0
            state[ORIGIN] = NONE
        else:
            continue
        _forget(work)
        state[PHASE], found = BEGINNING, UNFINISHED
    if found == UNFINISHED:
        # Those of some active set on the way say nothing about the point.
        work.multipliers[:] = 0.0
    return found if measure(problem, work) else LOST


@part
def _forget(work: Work) -> None:
    """Forgets what steps and leaps keep in mind."""
    work.state[IDLE] = work.state[BLOCKED] = work.state[LEAPS] = work.state[SINCE] = 0
    work.state[RELEASED] = -1
    for i in range(len(work.locked)):
        work.locked[i] = 0


@part
def _begin(problem: Problem, work: Work) -> bool:
    """Chooses how to go on by how much is wrong with an active set; returns whether nothing is."""
    state = work.state
    largest = find_violations(problem, work, work.target, work.goal)
    violated, pulling = count_violations(work), release(problem, work, 0.0)
    wrong = violated + pulling
    if wrong > 0 and state[CHANGES] == 1:
        find_values(problem, work.x, work.values)
    # Slack makes any point one to begin from.
    if wrong == 0 or is_better(problem, work):
        copy(work.x, work.target)
        copy(work.values, work.goal)
    state[PHASE] = STEPPING
    if 0 < wrong <= MANY and pulling == 0 and state[ORIGIN] != NONE:
        state[PHASE], state[LEAPS] = EXCHANGING, 1
        activate(work, 0.0)
        return False
    if wrong <= MANY or state[ORIGIN] == NONE:
        if find_violations(problem, work, work.x, work.values) > 0.0:
            activate(work, 0.0)
        return wrong == 0
    if state[ORIGIN] == LAST:
        # One leap may do where rows are only missing.
        state[ENOUGH] = state[CHANGES] + (1 if pulling == 0 else 0)
    state[PHASE], state[LEAPS], state[FEWEST] = LEAPING, 1, wrong
    activate(work, ADD_SHARES[0] * largest)
    return False


@part
def _step(problem: Problem, work: Work) -> bool:
    """Goes towards the optimum of the active set, and lets go of a row there; returns if none."""
    if _advance(problem, work):
        work.state[IDLE] = 0
        for i in range(len(work.locked)):
            work.locked[i] = 0
    else:
        work.state[IDLE] += 1
    if work.state[BLOCKED] != 0:
        return False
    share = FIRST if work.state[IDLE] > PATIENCE else STRONGEST
    return release(problem, work, share) == 0


@part
def _prepare(problem: Problem, work: Work) -> int:
    """Norms and sides of all rows; returns how many inequalities are active, or -1 if unsound."""
    m, n = problem.A.shape
    total, known = 0.0, 0
    for i in range(n):
        work.norms[i] = 1.0
        total += abs(problem.g[i])
        row = problem.H[i]
        for j in range(n):
            total += abs(row[j])
    for i in range(m):
        work.norms[n + i] = length_of(problem.A[i])
        total += work.norms[n + i]
    for i in range(n + m):
        low, up, side = problem.lower[i], problem.upper[i], work.side[i]
        # Written so that NaN is refused.
        if not (low <= up and low < np.inf and up > -np.inf and problem.weights[i] > 0.0):
            return -1
        total += problem.weights[i]
        if low == up:
            work.side[i], work.firm[i] = EQUALITY, 1
        elif side == EQUALITY or (side > 0 and up == np.inf) or (side < 0 and low == -np.inf):
            work.side[i] = 0
        if work.side[i] == 0:
            work.firm[i] = 0
        elif work.side[i] != EQUALITY:
            known += 1
        work.locked[i] = 0
    return known if total < np.inf else -1


@part
def _advance(problem: Problem, work: Work) -> bool:
    """Goes towards the optimum of the active set until a row stops it; returns if x moved."""
    x, target, values, goal = work.x, work.target, work.values, work.goal
    size = max(length_of(target), length_of(x))
    length, stop, side = 1.0, -1, 0
    for i in range(len(values)):
        if work.side[i] != 0:
            continue
        room = FEASIBILITY_TOLERANCE * work.norms[i] * size
        if goal[i] > problem.upper[i] + room:
            bound, towards = problem.upper[i], 1
        elif goal[i] < problem.lower[i] - room:
            bound, towards = problem.lower[i], -1
        else:
            continue
        share = max((bound - values[i]) / (goal[i] - values[i]), 0.0)
        if share < length:
            length, stop, side = share, i, towards
    work.state[BLOCKED] = 0
    if stop >= 0:
        work.state[BLOCKED] = 1
        if stop == work.state[RELEASED]:
            work.locked[stop] = 1
        work.side[stop] = side
        work.firm[stop] = 0
    square = 0.0
    for j in range(len(x)):
        step = target[j] - x[j]
        square += step * step
        x[j] = target[j] if stop < 0 else x[j] + length * step
    for i in range(len(values)):
        values[i] = goal[i] if stop < 0 else values[i] + length * (goal[i] - values[i])
    return length * np.sqrt(square) > MOVE_TOLERANCE * size
