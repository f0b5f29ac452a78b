"""How the active set changes: steps of one row, exchanges of one after the other, leaps of many.

A step goes from the point towards the target, as far as the first row that blocks it. Exchanges and
leaps look at the target alone. An exchange deactivates a row whose multiplier has the wrong sign
before it activates another, as dual methods do: where a tick violates a row or two, it mostly ends
within three. A leap changes many rows at once, as in block pivoting (Portugal, Judice, Vicente
1994, "A comparison of block pivoting and interior-point algorithms for linear least squares
problems with nonnegative variables"). Nothing says that either leads nearer. But where nothing is
wrong is the optimum, and mostly they get there in fewer factorisations than single steps.
"""

import numpy as np

from poise._compiled import part
from poise.hqp._active_set.kernels import copy, multiply, norm_of
from poise.hqp._active_set.multipliers import FIRST, LARGEST, deactivate_wrong_signs
from poise.hqp._active_set.workspace import (
    EQUALITY,
    LOCKED,
    RELEASED,
    STEPPING,
    Answer,
    Matrix,
    Points,
    Problem,
    Rows,
    State,
    Vector,
    Work,
)
from poise.hqp._measure import find_residuals, find_slacks
from poise.hqp._tolerances import (
    ADD_RATIOS,
    DROP_RATIOS,
    FEASIBILITY_TOLERANCE,
    LEAP_PATIENCE,
    MOST_EXCHANGES,
    MOST_LEAPS,
    MOVE_TOLERANCE,
    PATIENCE,
    SAME_TOLERANCE,
    SLACK_TOLERANCE,
)


@part
def exchange(problem: Problem, work: Work) -> bool:
    """Change one row: drop the worst multiplier of the wrong sign, or add a violated row."""
    state, points = work.state, work.points
    largest = find_violations(problem, work.rows, points.target, points.target_values)
    signs = deactivate_wrong_signs(problem, work, LARGEST)
    optimal = largest == 0.0 and signs == 0
    if optimal or is_better(problem, work.rows, points, work.answer):
        move_to_target(points)
    if optimal:
        return True
    state.turn += 1
    if state.turn == MOST_EXCHANGES:
        state.phase = STEPPING
        _begin_steps(problem, work.rows, points)
    elif signs == 0:
        activate(work.rows, largest)
    return False


@part
def leap(problem: Problem, work: Work) -> bool:
    """Change many rows; return whether there was nothing to change."""
    state, points = work.state, work.points
    turn = state.turn
    state.turn += 1
    largest = find_violations(problem, work.rows, points.target, points.target_values)
    wrong = count_violations(work.rows)
    wrong += deactivate_wrong_signs(problem, work, DROP_RATIOS[turn % len(DROP_RATIOS)])
    if wrong == 0 or is_better(problem, work.rows, points, work.answer):
        move_to_target(points)
    if wrong == 0:
        return True
    state.since += 1
    if wrong < state.fewest:
        state.fewest, state.since = wrong, 0
    if turn + 1 >= MOST_LEAPS or state.since >= LEAP_PATIENCE:
        state.phase = STEPPING
        _begin_steps(problem, work.rows, points)
    elif largest > 0.0:
        activate(work.rows, ADD_RATIOS[turn % len(ADD_RATIOS)] * largest)
    return False


@part
def step(problem: Problem, work: Work) -> bool:
    """Goes towards the target, and deactivates a row there; returns whether there was none."""
    state = work.state
    if _step_until_blocked(problem, work.rows, work.points, state):
        state.idle = 0
        for i in range(len(work.rows.locked)):
            work.rows.locked[i] = 0
    else:
        state.idle += 1
    if state.blocked != 0:
        return False
    which = FIRST if state.idle > PATIENCE else LARGEST
    return deactivate_wrong_signs(problem, work, which) == 0


@part
def _begin_steps(problem: Problem, rows: Rows, points: Points) -> None:
    """Makes active what the point violates, and nothing that it keeps away from."""
    size = FEASIBILITY_TOLERANCE * norm_of(points.x)
    for i in range(len(points.values)):
        value, room = points.values[i], size * rows.norm[i]
        if rows.side[i] != EQUALITY and problem.lower[i] + room < value < problem.upper[i] - room:
            rows.side[i] = rows.sign_free[i] = 0
    if find_violations(problem, rows, points.x, points.values) > 0.0:
        activate(rows, 0.0)


@part
def _step_until_blocked(problem: Problem, rows: Rows, points: Points, state: State) -> bool:
    """Goes towards the target until a row blocks the step; returns whether x moved."""
    x, target, values, goal = points.x, points.target, points.values, points.target_values
    size = max(norm_of(target), norm_of(x))
    length, blocking, side = 1.0, -1, 0
    for i in range(len(values)):
        if rows.side[i] != 0:
            continue
        room = FEASIBILITY_TOLERANCE * rows.norm[i] * size
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
        rows.side[blocking] = side
        rows.sign_free[blocking] = 0
    square = 0.0
    for j in range(len(x)):
        change = target[j] - x[j]
        square += change * change
        x[j] = target[j] if blocking < 0 else x[j] + length * change
    for i in range(len(values)):
        values[i] = goal[i] if blocking < 0 else values[i] + length * (goal[i] - values[i])
    return length * np.sqrt(square) > MOVE_TOLERANCE * size


@part
def find_values(A: Matrix, x: Vector, values: Vector) -> None:
    """Values of all bounds and rows at a point."""
    copy(values[: len(x)], x)
    multiply(A, x, values[len(x) :])


@part
def find_violations(problem: Problem, rows: Rows, x: Vector, values: Vector) -> float:
    """Find the signed violations of inactive rows, by their norms; return the largest."""
    size, largest = FEASIBILITY_TOLERANCE * norm_of(x), 0.0
    for i in range(len(values)):
        rows.violation[i] = 0.0
        if rows.side[i] != 0:
            continue
        over = max(values[i] - problem.upper[i], problem.lower[i] - values[i])
        if over > size * rows.norm[i]:
            far = over / rows.norm[i] if rows.norm[i] > 0.0 else over
            rows.violation[i] = far if values[i] > problem.upper[i] else -far
            largest = max(largest, far)
    return largest


@part
def count_violations(rows: Rows) -> int:
    """How many rows `find_violations` found."""
    count = 0
    for i in range(len(rows.violation)):
        count += 1 if rows.violation[i] != 0.0 else 0
    return count


@part
def activate(rows: Rows, least: float) -> None:
    """Makes rows active that are violated by at least so much."""
    for i in range(len(rows.violation)):
        far = rows.violation[i]
        if far != 0.0 and abs(far) >= least:
            rows.side[i] = 1 if far > 0.0 else -1
            rows.sign_free[i] = 0


@part
def move_to_target(points: Points) -> None:
    """Makes the target the point."""
    copy(points.x, points.target)
    copy(points.values, points.target_values)


@part
def is_better(problem: Problem, rows: Rows, points: Points, answer: Answer) -> bool:
    """Whether the target meets the levels better than the point, or as well."""
    lower, upper, weights = problem.lower, problem.upper, problem.weights
    find_residuals(lower, upper, weights, rows.level, points.values, answer.residuals)
    find_residuals(lower, upper, weights, rows.level, points.target_values, answer.target_residuals)
    reach = max(norm_of(points.x), norm_of(points.target))
    for level in range(len(answer.residuals)):
        old, new, size = answer.residuals[level], answer.target_residuals[level], 0.0
        for i in range(len(weights)):
            if rows.level[i] == level:
                size = max(size, rows.norm[i] * weights[i])
        # A level that both meet is met to rounding. Written so that what is no number is no better.
        room = max(SAME_TOLERANCE * max(old, new), SLACK_TOLERANCE * size * reach)
        if not abs(old - new) <= room:
            return bool(new < old)
    return True


@part
def measure(problem: Problem, work: Work) -> bool:
    """Slacks of all rows, residuals of all levels; returns whether all that was found is finite."""
    answer, values = work.answer, work.points.values
    lower, upper, weights, level = problem.lower, problem.upper, problem.weights, work.rows.level
    find_slacks(lower, upper, values, answer.slacks)
    find_residuals(lower, upper, weights, level, values, answer.residuals)
    # The levels' scales are their residuals at x = 0.
    work.rows.violation[:] = 0.0
    find_residuals(lower, upper, weights, level, work.rows.violation, answer.relative)
    for p in range(len(answer.residuals)):
        answer.relative[p] = answer.residuals[p] / max(answer.relative[p], 1.0)
    total = 0.0
    for j in range(len(work.points.x)):
        total += abs(work.points.x[j])
    for i in range(len(answer.slacks)):
        total += abs(answer.slacks[i])
        for p in range(len(work.duals.multipliers)):
            total += abs(work.duals.multipliers[p, i])
    for p in range(len(answer.residuals)):
        total += answer.residuals[p]
    return bool(total < np.inf)
