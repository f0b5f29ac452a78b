"""The search for the active set, from set to set until the optimum of one is that of the problem.

Each round finds the optimum of the active set, the target, and changes the set by what is wrong
there: inactive rows that are violated, active rows whose multiplier has the wrong sign.
"""

import numpy as np

from poise._compiled import compiled, part, view
from poise.hqp._active_set.guess import guess
from poise.hqp._active_set.kernels import copy, find_norms
from poise.hqp._active_set.moves import (
    activate,
    change_rows,
    find_values,
    find_violations,
    measure,
    move_to_better,
    step,
)
from poise.hqp._active_set.multipliers import (
    deactivate_wrong_signs,
    depends_on_rank,
    find_moved,
    guard,
    is_optimal,
)
from poise.hqp._active_set.optimum import damp_equalities, find_optimum
from poise.hqp._active_set.workspace import (
    BEGINNING,
    EQUALITY,
    EXCHANGING,
    GUESS,
    LAST,
    LEAPING,
    NOTHING,
    STEPPING,
    Duals,
    Indices,
    Matrix,
    Problem,
    RowStates,
    SearchWork,
    State,
)
from poise.hqp._tolerances import ADD_RATIOS, ASTRAY, COLD_CHANGES, MANY, WARM_CHANGES

CONVERGED, DOUBTFUL, UNFINISHED, UNSOUND, LOST = range(5)
"""Ends of a call: an optimum, a doubtful one, the cap, an invalid problem, an answer not finite."""


@compiled
def search(problem_at: int, work_at: int, changes: int) -> int:
    """Search from the active set in the workspace, or continue the search of the last call."""
    problem, work = view(Problem, problem_at), view(SearchWork, work_at)
    state, found = work.state, UNFINISHED
    if state.begun == 0 and not _begin_search(problem, work):
        return UNSOUND
    while state.changes < changes:
        state.changes += 1
        find_optimum(problem, work)
        find_values(problem.A, work.points.target, work.points.target_values)
        if state.phase == BEGINNING:
            optimal = _choose_phase(problem, work)
        elif state.phase == STEPPING:
            optimal = step(problem, work)
        else:
            optimal = change_rows(problem, work)
        sound = optimal and is_optimal(problem, work)
        moved = find_moved(problem, work) if sound else -1
        if sound and moved < 0:
            found = DOUBTFUL if depends_on_rank(problem, work) else CONVERGED
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
            for i in range(len(work.rows.side)):
                if work.rows.side[i] != EQUALITY:
                    work.rows.side[i] = 0
            _begin_from(NOTHING, state, work.rows)
    if found == UNFINISHED:
        # Multipliers of an intermediate active set are not those of the solution.
        work.duals.multipliers[:] = 0.0
    return found if measure(problem, work) else LOST


@part
def begin_with(work: SearchWork, sides: Indices) -> None:
    """Make the next search begin with an active set, and with nothing else of the last problem."""
    rows = work.rows
    work.state.begun = 0
    work.points.x[:] = 0.0
    for k in range(len(rows.side)):
        rows.side[k] = sides[k] if k < len(sides) else 0
        rows.sign_free[k] = rows.locked[k] = rows.needed_by[k] = rows.factored[k] = 0


@part
def _begin_search(problem: Problem, work: SearchWork) -> bool:
    """Prepare the workspace for a new problem; return whether its numbers can be one."""
    inequalities = _prepare_rows(problem, work.rows, work.duals)
    if inequalities < 0:
        return False
    damp_equalities(problem, work)
    work.duals.multipliers[:] = 0.0
    state = work.state
    state.begun, state.changes = 1, 0
    state.guess_at = WARM_CHANGES if inequalities > 0 else COLD_CHANGES
    _begin_from(LAST, state, work.rows)
    return True


@part
def _begin_from(origin: int, state: State, rows: RowStates) -> None:
    """Begin with another active set."""
    state.origin, state.phase = origin, BEGINNING
    state.idle = state.blocked = state.turn = state.since = state.fewest = 0
    state.deactivated, state.doubtful = -1, 0
    for i in range(len(rows.locked)):
        rows.locked[i] = rows.returns[i] = 0


@part
def _choose_phase(problem: Problem, work: SearchWork) -> bool:
    """Choose the phase by the number of wrong rows; return whether there are none."""
    state, rows, points = work.state, work.rows, work.points
    largest = find_violations(problem, work, points.target, points.target_values)
    signs = deactivate_wrong_signs(problem, work, 0.0)
    wrong = state.violated + signs
    if wrong > 0 and state.changes == 1:
        find_values(problem.A, points.x, points.values)
    move_to_better(problem, work, wrong)
    state.phase = STEPPING
    if 0 < wrong <= MANY and signs == 0 and state.origin != NOTHING:
        state.phase, state.turn = EXCHANGING, 1
        activate(rows, 0.0)
    elif wrong <= MANY or state.origin == NOTHING:
        find_violations(problem, work, points.x, points.values)
        activate(rows, 0.0)
    else:
        if state.origin == LAST:
            # One leap may suffice where rows are only missing.
            state.guess_at = state.changes + (1 if signs == 0 else 0)
        state.phase, state.turn, state.fewest = LEAPING, 1, wrong
        activate(rows, ADD_RATIOS[0] * largest)
    return wrong == 0


@part
def _prepare_rows(problem: Problem, rows: RowStates, duals: Duals) -> int:
    """Find norms and sides; return the count of active inequalities, or -1 for unsound numbers."""
    m, n = problem.A.shape
    total, inequalities, sums = 0.0, 0, duals.gradient
    copy(sums, problem.g)
    for i in range(n):
        row = problem.H[i]
        for j in range(n):
            sums[j] = abs(sums[j]) + abs(row[j])
    rows.norm[:n] = 1.0
    find_norms(problem.A, rows.norm[n:])
    for i in range(n):
        total += sums[i]
    for i in range(n + m):
        total += rows.norm[i]
        rows.guarded[i] = 0
        low, up, side = problem.lower[i], problem.upper[i], rows.side[i]
        # Comparisons that fail on NaN.
        if not (low <= up and low < np.inf and up > -np.inf and problem.weights[i] > 0.0):
            return -1
        total += problem.weights[i]
        if low == up:
            rows.side[i], rows.sign_free[i] = EQUALITY, 1
        elif side == EQUALITY:
            rows.side[i] = _side_of(duals.multipliers, i)
        if (rows.side[i] == 1 and up == np.inf) or (rows.side[i] == -1 and low == -np.inf):
            rows.side[i] = 0
        if rows.side[i] == 0:
            rows.sign_free[i] = 0
        elif rows.side[i] != EQUALITY:
            inequalities += 1
    return inequalities if total < np.inf else -1


@part
def _side_of(multipliers: Matrix, index: int) -> int:
    """Return the side that an equality of the last problem would have had as an inequality."""
    for level in range(len(multipliers)):
        if multipliers[level, index] != 0.0:
            return 1 if multipliers[level, index] > 0.0 else -1
    return 0
