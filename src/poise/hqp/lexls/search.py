"""The search for the active set, compiled: `reference.py` with loops written out."""

import numpy as np
from jaxtyping import Float64, Int64

from poise.hqp.lexls.leaps import leap
from poise.hqp.lexls.measure import check, find_values, measure
from poise.hqp.lexls.multipliers import EQUALITY, FIRST, STRONGEST, release
from poise.hqp.lexls.optimum import find_optimum
from poise.hqp.lexls.reflections import length_of
from poise.hqp.lexls.tolerances import (
    DROP_SHARE,
    FEASIBILITY_TOLERANCE,
    MOST_LEAPS,
    MOVE_TOLERANCE,
    PATIENCE,
)
from poise.hqp.lexls.workspace import (
    BEGUN,
    BLOCKED,
    CHANGES,
    IDLE,
    RELEASED,
    Problem,
    Work,
    cut,
)
from poise.linalg import compiled

CONVERGED, UNFINISHED, UNSOUND = range(3)
"""How a call ended; the last: the numbers cannot be a problem."""


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
        `CONVERGED`, `UNFINISHED` or `UNSOUND`.
    """
    m, n = A.shape
    problem = Problem(A, lower, upper, weights, H, g, damping, starts, bounds_level)
    work = cut(floats, ints, n, m, len(starts) - 1)
    state = work.state
    if state[BEGUN] == 0:
        if not _prepare(problem, work):
            return UNSOUND
        for place in range(len(state)):
            state[place] = 0
        state[BEGUN], state[RELEASED] = 1, -1
    found = UNFINISHED
    while state[CHANGES] < changes:
        state[CHANGES] += 1
        find_optimum(problem, work)
        find_values(problem, work.target, work.goal)
        leaping = state[CHANGES] <= MOST_LEAPS
        if leap(problem, work) if leaping else _step(problem, work):
            found = CONVERGED
            check(problem, work)
            break
    measure(problem, work)
    return found


@compiled
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
    idle, share = work.state[IDLE], DROP_SHARE
    if idle > 0:
        share = FIRST if idle > PATIENCE else STRONGEST
    return not release(problem, work, share)


@compiled
def _prepare(problem: Problem, work: Work) -> bool:
    """Norms and sides of all rows; returns whether all numbers can be right."""
    m, n = problem.A.shape
    total = 0.0
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
            return False
        total += problem.weights[i]
        if low == up:
            work.side[i], work.firm[i] = EQUALITY, 1
        elif side == EQUALITY or (side > 0 and up == np.inf) or (side < 0 and low == -np.inf):
            work.side[i] = 0
        if work.side[i] == 0:
            work.firm[i] = 0
        work.locked[i] = 0
    return bool(total < np.inf)


@compiled
def _advance(problem: Problem, work: Work) -> bool:
    """Goes towards the optimum of the active set until a row stops it; returns if x moved."""
    x, target, values, goal = work.x, work.target, work.values, work.goal
    size = max(length_of(target), length_of(x))
    length, stop = 1.0, -1
    for i in range(len(values)):
        if work.side[i] != 0:
            continue
        room = FEASIBILITY_TOLERANCE * work.norms[i] * size
        if goal[i] > problem.upper[i] + room:
            bound = problem.upper[i]
        elif goal[i] < problem.lower[i] - room:
            bound = problem.lower[i]
        else:
            continue
        share = max((bound - values[i]) / (goal[i] - values[i]), 0.0)
        if share < length:
            length, stop = share, i
    work.state[BLOCKED] = 0
    if stop >= 0:
        work.state[BLOCKED] = 1
        if stop == work.state[RELEASED]:
            work.locked[stop] = 1
        work.side[stop] = 1 if goal[stop] > values[stop] else -1
        work.firm[stop] = 0
    square = 0.0
    for j in range(len(x)):
        step = target[j] - x[j]
        square += step * step
        x[j] = target[j] if stop < 0 else x[j] + length * step
    for i in range(len(values)):
        values[i] = goal[i] if stop < 0 else values[i] + length * (goal[i] - values[i])
    return length * np.sqrt(square) > MOVE_TOLERANCE * size
