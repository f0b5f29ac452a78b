"""The search for the active set: from set to set, until the optimum of one is that of the problem.

Each round finds the optimum of the active set, the target, and changes the set by what is wrong
there: inactive rows that are violated, active rows whose multiplier has the wrong sign.
"""

import numpy as np

from poise._compiled import compiled, part, view
from poise.hqp._active_set.damping import damp_equalities
from poise.hqp._active_set.guess import guess
from poise.hqp._active_set.kernels import norm_of
from poise.hqp._active_set.moves import (
    activate,
    count_violations,
    exchange,
    find_values,
    find_violations,
    is_better,
    leap,
    measure,
    move_to_target,
    step,
)
from poise.hqp._active_set.multipliers import deactivate_wrong_signs, is_optimal
from poise.hqp._active_set.optimum import find_optimum
from poise.hqp._active_set.strictness import find_moved, guard, hangs_on_rank
from poise.hqp._active_set.workspace import (
    BEGINNING,
    EQUALITY,
    EXCHANGING,
    GUESS,
    LAST,
    LEAPING,
    NOTHING,
    STEPPING,
    Matrix,
    Problem,
    Rows,
    State,
    Vector,
    Work,
)
from poise.hqp._tolerances import ADD_RATIOS, ASTRAY, COLD_CHANGES, MANY, WARM_CHANGES

CONVERGED, DOUBTFUL, UNFINISHED, UNSOUND, LOST = range(5)
"""How a call ended: at an optimum, at what may be none, at the cap, with numbers that cannot be a
problem, with an answer that is no number."""


@compiled
def search(problem_at: int, work_at: int, changes: int) -> int:
    """Searches from the active set in the workspace, or goes on where the last call ended."""
    problem, work = view(Problem, problem_at), view(Work, work_at)
    state, found = work.state, UNFINISHED
    if state.begun == 0 and not _begin_search(problem, work):
        return UNSOUND
    while state.changes < changes:
        state.changes += 1
        find_optimum(problem, work)
        find_values(problem.A, work.points.target, work.points.target_values)
        optimal = _change_active_set(problem, work)
        sound = optimal and is_optimal(problem, work)
        moved = find_moved(problem, work) if sound else -1
        if sound and moved < 0:
            found = DOUBTFUL if hangs_on_rank(problem, work) else CONVERGED
            break
        if sound and guard(problem, work, moved):
            _begin_from(state.origin, state, work.rows)
            state.guess_at = state.changes + WARM_CHANGES
            continue
        if optimal and state.origin == NOTHING:
            found = DOUBTFUL
            break
        if state.origin == LAST and (optimal or state.changes == state.guess_at):
            guess(problem, work)
            _begin_from(GUESS, state, work.rows)
        elif state.origin == GUESS and (optimal or state.changes >= ASTRAY):
            _deactivate_all(work.rows)
            _begin_from(NOTHING, state, work.rows)
    if found == UNFINISHED:
        # Those of some active set on the way say nothing about the point.
        work.duals.multipliers[:] = 0.0
    return found if measure(problem, work) else LOST


@part
def _begin_search(problem: Problem, work: Work) -> bool:
    """Gets everything ready for a new problem; returns whether its numbers can be one."""
    inequalities = _prepare_rows(problem, work.rows, work.duals.multipliers)
    if inequalities < 0:
        return False
    if _is_damped(problem.damping):
        damp_equalities(problem, work)
    work.duals.multipliers[:] = 0.0
    state = work.state
    state.begun, state.changes = 1, 0
    state.guess_at = WARM_CHANGES if inequalities > 0 else COLD_CHANGES
    _begin_from(LAST, state, work.rows)
    return True


@part
def _is_damped(damping: Vector) -> bool:
    """Whether any level is."""
    total = 0.0
    for level in range(len(damping)):
        total += damping[level]
    return total > 0.0


@part
def _begin_from(origin: int, state: State, rows: Rows) -> None:
    """Forgets what steps and leaps keep in mind, to begin with an active set from somewhere."""
    state.origin, state.phase = origin, BEGINNING
    state.idle = state.blocked = state.turn = state.since = state.fewest = 0
    state.deactivated, state.doubtful = -1, 0
    for i in range(len(rows.locked)):
        rows.locked[i] = 0


@part
def _deactivate_all(rows: Rows) -> None:
    """Leaves the equalities alone active."""
    for i in range(len(rows.side)):
        if rows.side[i] != EQUALITY:
            rows.side[i] = 0


@part
def _change_active_set(problem: Problem, work: Work) -> bool:
    """Goes on in the way of the phase; returns whether nothing was wrong with the active set."""
    phase = work.state.phase
    if phase == BEGINNING:
        return _choose_phase(problem, work)
    if phase == LEAPING:
        return leap(problem, work)
    if phase == EXCHANGING:
        return exchange(problem, work)
    return step(problem, work)


@part
def _choose_phase(problem: Problem, work: Work) -> bool:
    """Chooses how to go on by how much is wrong with an active set; returns whether nothing is."""
    state, rows, points = work.state, work.rows, work.points
    largest = find_violations(problem, rows, points.target, points.target_values)
    violated = count_violations(rows)
    signs = deactivate_wrong_signs(problem, work, 0.0)
    wrong = violated + signs
    if wrong > 0 and state.changes == 1:
        find_values(problem.A, points.x, points.values)
    # Slack makes any point one to begin from.
    if wrong == 0 or is_better(problem, rows, points, work.answer):
        move_to_target(points)
    state.phase = STEPPING
    if 0 < wrong <= MANY and signs == 0 and state.origin != NOTHING:
        state.phase, state.turn = EXCHANGING, 1
        activate(rows, 0.0)
    elif wrong <= MANY or state.origin == NOTHING:
        if find_violations(problem, rows, points.x, points.values) > 0.0:
            activate(rows, 0.0)
    else:
        if state.origin == LAST:
            # One leap may do where rows are only missing.
            state.guess_at = state.changes + (1 if signs == 0 else 0)
        state.phase, state.turn, state.fewest = LEAPING, 1, wrong
        activate(rows, ADD_RATIOS[0] * largest)
    return wrong == 0


@part
def _prepare_rows(problem: Problem, rows: Rows, multipliers: Matrix) -> int:
    """Norms, levels and sides of all rows; how many inequalities are active, or -1 if unsound."""
    m, n = problem.A.shape
    total, inequalities = 0.0, 0
    for i in range(n):
        rows.norm[i], rows.level[i] = 1.0, problem.bounds_level
        total += abs(problem.g[i])
        row = problem.H[i]
        for j in range(n):
            total += abs(row[j])
    for level in range(len(problem.starts) - 1):
        for i in range(problem.starts[level], problem.starts[level + 1]):
            rows.level[n + i] = level
    for i in range(m):
        rows.norm[n + i] = norm_of(problem.A[i])
        total += rows.norm[n + i]
    for i in range(n + m):
        rows.guarded[i] = 0
        low, up, side = problem.lower[i], problem.upper[i], rows.side[i]
        # Written so that NaN is refused.
        if not (low <= up and low < np.inf and up > -np.inf and problem.weights[i] > 0.0):
            return -1
        total += problem.weights[i]
        if low == up:
            rows.side[i], rows.sign_free[i] = EQUALITY, 1
        elif side == EQUALITY:
            rows.side[i] = _side_of(multipliers, i)
        if (rows.side[i] == 1 and up == np.inf) or (rows.side[i] == -1 and low == -np.inf):
            rows.side[i] = 0
        if rows.side[i] == 0:
            rows.sign_free[i] = 0
        elif rows.side[i] != EQUALITY:
            inequalities += 1
    return inequalities if total < np.inf else -1


@part
def _side_of(multipliers: Matrix, index: int) -> int:
    """The side that an equality of the last problem would have had as an inequality."""
    for level in range(len(multipliers)):
        if multipliers[level, index] != 0.0:
            return 1 if multipliers[level, index] > 0.0 else -1
    return 0
