"""Changes of the active set: steps of one row, exchanges of one after the other, leaps of many.

A step goes from the point towards the target, as far as the first row that blocks it. Exchanges and
leaps regard the target alone. An exchange deactivates a row whose multiplier has the wrong sign
before it activates another, as dual methods do: where a tick violates a row or two, it mostly ends
within three. A leap changes many rows, as in block pivoting (Portugal, Judice, Vicente 1994, "A
comparison of block pivoting and interior-point algorithms for linear least squares problems with
nonnegative variables"). Neither is sure to come nearer. But a set with nothing wrong is the
optimum, and mostly they get there in fewer factorisations than single steps.
"""

import numpy as np

from poise._compiled import part
from poise.hqp._active_set.kernels import copy, measure_values, multiply, norm_of
from poise.hqp._active_set.multipliers import FIRST, LARGEST, deactivate_wrong_signs
from poise.hqp._active_set.workspace import (
    EQUALITY,
    LEAPING,
    LOCKED,
    RELEASED,
    STEPPING,
    Matrix,
    Points,
    Problem,
    RowStates,
    SearchWork,
    State,
    Vector,
)
from poise.hqp._tolerances import (
    ADD_RATIOS,
    DROP_RATIOS,
    MET_TOLERANCE,
    MOST_EXCHANGES,
    MOST_LEAPS,
    PATIENCE,
    POINT_TOLERANCE,
    SLACK_TOLERANCE,
)


@part
def change_rows(problem: Problem, work: SearchWork) -> bool:
    """Leap, or exchange one row; return whether nothing was wrong with the active set."""
    state, rows, points, leaping = work.state, work.rows, work.points, work.state.phase == LEAPING
    turn = state.turn
    largest = find_violations(problem, work, points.target, points.target_values)
    ratio = DROP_RATIOS[turn % len(DROP_RATIOS)] if leaping else LARGEST
    signs = deactivate_wrong_signs(problem, work, ratio)
    wrong = state.violated + signs
    move_to_better(problem, work, wrong)
    if wrong == 0:
        return True
    state.turn, state.since = turn + 1, state.since + 1
    if wrong < state.fewest:
        state.fewest, state.since = wrong, 0
    if leaping and turn + 1 < MOST_LEAPS and state.since < MOST_EXCHANGES:
        activate(rows, ADD_RATIOS[turn % len(ADD_RATIOS)] * largest)
    elif not leaping and turn + 1 < MOST_EXCHANGES:
        if signs == 0:
            activate(rows, largest)
    else:
        _begin_steps(problem, work)
    return False


@part
def step(problem: Problem, work: SearchWork) -> bool:
    """Go towards the target and deactivate a row there; return whether there was none."""
    state = work.state
    if _step_until_blocked(problem, work.rows, work.points, state):
        state.idle = 0
        for i in range(len(work.rows.locked)):
            work.rows.locked[i] = LOCKED if work.rows.returns[i] > PATIENCE else 0
    else:
        state.idle += 1
    if state.blocked != 0:
        return False
    which = FIRST if state.idle > PATIENCE else LARGEST
    return deactivate_wrong_signs(problem, work, which) == 0


@part
def _begin_steps(problem: Problem, work: SearchWork) -> None:
    """Activate the rows that the point violates, and deactivate those with room at the point."""
    rows, points = work.rows, work.points
    work.state.phase = STEPPING
    size = POINT_TOLERANCE * norm_of(points.x)
    for i in range(len(points.values)):
        value, room = points.values[i], size * rows.norm[i]
        if rows.side[i] != EQUALITY and problem.lower[i] + room < value < problem.upper[i] - room:
            rows.side[i] = rows.sign_free[i] = 0
    find_violations(problem, work, points.x, points.values)
    activate(rows, 0.0)


@part
def _step_until_blocked(problem: Problem, rows: RowStates, points: Points, state: State) -> bool:
    """Go towards the target until a row blocks the step; return whether x moved."""
    x, target, values, goal = points.x, points.target, points.values, points.target_values
    size = max(norm_of(target), norm_of(x))
    length, blocking, side = 1.0, -1, 0
    for i in range(len(values)):
        if rows.side[i] != 0:
            continue
        room = POINT_TOLERANCE * rows.norm[i] * size
        if goal[i] > problem.upper[i] + room:
            bound, towards = problem.upper[i], 1
        elif goal[i] < problem.lower[i] - room:
            bound, towards = problem.lower[i], -1
        else:
            continue
        ratio = max((bound - values[i]) / (goal[i] - values[i]), 0.0)
        if ratio < length:
            length, blocking, side = ratio, i, towards
    state.blocked = 0
    if blocking >= 0:
        state.blocked = 1
        if blocking == state.deactivated or rows.locked[blocking] == RELEASED:
            rows.locked[blocking] = LOCKED
            rows.returns[blocking] += 1
        rows.side[blocking] = side
        rows.sign_free[blocking] = 0
    square = 0.0
    for j in range(len(x)):
        change = target[j] - x[j]
        square += change * change
        x[j] = target[j] if blocking < 0 else x[j] + length * change
    for i in range(len(values)):
        values[i] = goal[i] if blocking < 0 else values[i] + length * (goal[i] - values[i])
    return length * np.sqrt(square) > POINT_TOLERANCE * size


@part
def find_values(A: Matrix, x: Vector, values: Vector) -> None:
    """Find the values of all bounds and rows at a point."""
    copy(values[: len(x)], x)
    multiply(A, x, values[len(x) :])


@part
def find_violations(problem: Problem, work: SearchWork, x: Vector, values: Vector) -> float:
    """Find and count the signed violations of inactive rows, by norm; return the largest."""
    rows, size, largest = work.rows, POINT_TOLERANCE * norm_of(x), 0.0
    work.state.violated = 0
    for i in range(len(values)):
        rows.violation[i] = 0.0
        if rows.side[i] != 0:
            continue
        over = max(values[i] - problem.upper[i], problem.lower[i] - values[i])
        if over > size * rows.norm[i]:
            far = over / rows.norm[i] if rows.norm[i] > 0.0 else over
            rows.violation[i] = far if values[i] > problem.upper[i] else -far
            largest = max(largest, far)
            work.state.violated += 1
    return largest


@part
def activate(rows: RowStates, least: float) -> None:
    """Activate rows that are violated by at least `least`."""
    for i in range(len(rows.violation)):
        far = rows.violation[i]
        if far != 0.0 and abs(far) >= least:
            rows.side[i] = 1 if far > 0.0 else -1
            rows.sign_free[i] = 0


@part
def move_to_better(problem: Problem, work: SearchWork, wrong: int) -> None:
    """Make the target the point, where no row is wrong or the levels are met no worse there."""
    points = work.points
    if wrong == 0 or _is_better(problem, work):
        copy(points.x, points.target)
        copy(points.values, points.target_values)


@part
def _is_better(problem: Problem, work: SearchWork) -> bool:
    """Return whether the target meets the levels better than the point, or as well."""
    lower, upper, weights = problem.lower, problem.upper, problem.weights
    rows, points, answer = work.rows, work.points, work.answer
    level_of, slacks = rows.level, answer.slacks
    old, new = answer.residuals, answer.target_residuals
    measure_values(lower, upper, weights, level_of, points.values, slacks, old)
    measure_values(lower, upper, weights, level_of, points.target_values, slacks, new)
    reach = max(norm_of(points.x), norm_of(points.target))
    for level in range(len(old)):
        size = 0.0
        for i in range(len(weights)):
            if level_of[i] == level:
                size = max(size, rows.norm[i] * weights[i])
        # A level that both meet is met to rounding. NaN is never better.
        room = max(MET_TOLERANCE * max(old[level], new[level]), SLACK_TOLERANCE * size * reach)
        if not abs(old[level] - new[level]) <= room:
            return bool(new[level] < old[level])
    return True


@part
def measure(problem: Problem, work: SearchWork) -> bool:
    """Find slacks and residuals at the point; return whether the whole answer is finite."""
    answer, values = work.answer, work.points.values
    lower, upper, weights, level = problem.lower, problem.upper, problem.weights, work.rows.level
    # The levels' scales are their residuals at x = 0.
    zeros = work.rows.violation
    zeros[:] = 0.0
    measure_values(lower, upper, weights, level, zeros, answer.slacks, answer.relative)
    measure_values(lower, upper, weights, level, values, answer.slacks, answer.residuals)
    for p in range(len(answer.residuals)):
        answer.relative[p] = answer.residuals[p] / max(answer.relative[p], 1.0)
    total = 0.0
    for j in range(len(work.points.x)):
        total += abs(work.points.x[j])
    for i in range(len(answer.slacks)):
        total += abs(answer.slacks[i])
    for p in range(len(work.duals.multipliers)):
        multipliers = work.duals.multipliers[p]
        for i in range(len(multipliers)):
            total += abs(multipliers[i])
    for p in range(len(answer.residuals)):
        total += answer.residuals[p]
    return bool(total < np.inf)
