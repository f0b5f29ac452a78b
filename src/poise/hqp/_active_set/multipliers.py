"""Multipliers at the optimum of an active set, its optimality conditions, and its strictness.

The conditions are checked with the problem's own rows, not with those that were factored.
"""

from math import sqrt

import numpy as np

from poise._compiled import part
from poise.hqp._active_set.kernels import (
    add_multiple,
    add_rows,
    copy,
    measure_values,
    norm_of,
    reflect,
)
from poise.hqp._active_set.workspace import (
    EQUALITY,
    LOCKED,
    RELEASED,
    STEPPING,
    UNKNOWN,
    Duals,
    Factor,
    Matrix,
    Problem,
    RowStates,
    SearchWork,
    State,
    Vector,
)
from poise.hqp._tolerances import (
    CANCELLATION,
    FACTOR_TOLERANCE,
    OPTIMALITY_TOLERANCE,
    PATIENCE,
    POINT_TOLERANCE,
)

LARGEST, FIRST = 2.0, 3.0
"""Instead of a ratio of `deactivate_wrong_signs`: the one row to deactivate."""


@part
def deactivate_wrong_signs(problem: Problem, work: SearchWork, ratio: float) -> int:
    """Find multipliers at the optimum of the active set; deactivate rows of the wrong sign.

    A level's slack is its own multiplier, and the levels above balance it. Of a row's multipliers,
    highest level first, the first nonzero one must have the sign of its side; the others are free.
    """
    factor, rows, multipliers = work.factor, work.rows, work.duals.multipliers
    state = work.state
    levels = len(factor.rank)
    active = factor.begin[levels]
    state.deactivated, state.doubtful = -1, 0
    for place in range(active):
        index = factor.order[place]
        rows.sign_free[index] = 1 if rows.side[index] == EQUALITY else 0
        rows.needed_by[index] = 0
    multipliers[:] = 0.0
    for level in range(levels + 1):
        above = active
        if level < levels:
            wrong = _take_slacks(problem, work, multipliers[level], level)
            if wrong > 0:
                return wrong
            size = _slack_force(factor, level)
            if size == 0.0:
                continue
            work.duals.gradient[:] = 0.0
            begin, end = factor.begin[level], factor.begin[level + 1]
            _add_active(problem.A, factor, work.duals, level, begin, end)
            above = factor.begin[level]
        else:
            size = _find_cost_gradient(problem, work)
        _balance(problem, factor, work.duals, level)
        wrong = _deactivate_above(rows, factor, work.duals, state, level, above, size, ratio)
        if wrong > 0:
            return wrong
        if level < levels:
            reach = norm_of(factor.y)
            # Rows with slack have multipliers of either sign below their level.
            for place in range(factor.begin[level], factor.begin[level + 1]):
                if _is_clear(factor, place, size, reach):
                    rows.sign_free[factor.order[place]] = 1
    return 0


@part
def _take_slacks(problem: Problem, work: SearchWork, found: Vector, level: int) -> int:
    """Take slacks as multipliers; deactivate rows of the wrong sign, and return their count.

    Slack that is rounding has no sign: a row that it deactivates may block the very next step.
    """
    rows, factor, state = work.rows, work.factor, work.state
    wrong, size, reach = 0, -1.0, 0.0
    for place in range(factor.begin[level], factor.begin[level + 1]):
        slack, index = factor.slack[place], factor.order[place]
        if slack == 0.0:
            continue
        found[index] = slack * problem.weights[index]
        side = rows.side[index]
        if side != EQUALITY and slack * side < 0.0:
            if size < 0.0:
                size, reach = _slack_force(factor, level), norm_of(factor.y)
            if rows.locked[index] == LOCKED:
                if abs(slack) * factor.size[place] > OPTIMALITY_TOLERANCE * size:
                    state.doubtful = 1
            elif _is_clear(factor, place, size, reach):
                wrong += 1
                # It may violate its other bound.
                value = work.points.target_values[index]
                room = POINT_TOLERANCE * rows.norm[index] * norm_of(work.points.target)
                over = value > problem.upper[index] + room
                under = value < problem.lower[index] - room
                rows.side[index] = 1 if over else (-1 if under else 0)
                rows.sign_free[index] = 0
                if state.phase == STEPPING:
                    rows.locked[index] = RELEASED
        elif rows.sign_free[index] == 0:
            rows.needed_by[index] = 1 + level
    return wrong


@part
def _slack_force(factor: Factor, level: int) -> float:
    """Return the size of the terms in the gradient of half a level's squared slack."""
    square = 0.0
    for place in range(factor.begin[level], factor.begin[level + 1]):
        force = factor.slack[place] * factor.size[place]
        square += force * force
    return sqrt(square)


@part
def _is_clear(factor: Factor, place: int, size: float, reach: float) -> bool:
    """Return whether an active row's slack exceeds rounding, by its force or its unit."""
    slack = abs(factor.slack[place])
    own = abs(factor.bound[place]) + factor.size[place] * reach
    return bool(
        slack * factor.size[place] > FACTOR_TOLERANCE * size or slack > FACTOR_TOLERANCE * own
    )


@part
def _find_cost_gradient(problem: Problem, work: SearchWork) -> float:
    """Find the gradient of the final cost; return the size of its terms."""
    x, size = work.points.target, 0.0
    for i in range(len(x)):
        row, total, terms = problem.H[i], problem.g[i], abs(problem.g[i])
        for j in range(len(x)):
            term = row[j] * x[j]
            total += term
            # Not of H x itself, which is rounding where x lies in the kernel of H.
            terms += abs(term)
        work.cost.gradient[i], size = total, max(size, terms)
    copy(work.duals.gradient, work.cost.gradient)
    return size


@part
def _balance(problem: Problem, factor: Factor, duals: Duals, level: int) -> None:
    """Find the multipliers of the levels above, of rows with a coordinate, that balance it."""
    gradient, turned, whole = duals.gradient, duals.turned, factor.whole
    if level > whole:
        base = factor.first[whole]
        turned[base:] = 0.0
        for i in range(len(gradient)):
            add_multiple(turned[base:], gradient[i], factor.Q[i, base:])
        for k in range(base, factor.first[level]):
            reflect(turned[k:], factor.V[k, k:], factor.tau[k])
        for upper in range(level - 1, whole - 1, -1):
            _balance_above(problem, factor, duals, level, upper, base)
        _add_active(problem.A, factor, duals, level, factor.begin[whole], factor.begin[level])
    last = min(level, whole)
    copy(turned, gradient)
    for k in range(factor.first[last]):
        reflect(turned[k:], factor.V[k, k:], factor.tau[k])
    for upper in range(last - 1, -1, -1):
        _balance_above(problem, factor, duals, level, upper, 0)


@part
def _balance_above(
    problem: Problem, factor: Factor, duals: Duals, level: int, upper: int, base: int
) -> None:
    """Find the multipliers of one level above, and subtract its rows from a column on."""
    turned, begin, first = duals.turned, factor.begin[upper], factor.first[upper]
    for k in range(factor.first[upper + 1] - first - 1, -1, -1):
        column = first + k
        if turned[column] == 0.0:
            continue
        row, index = factor.R[begin + k], factor.order[begin + k]
        multiplier = -turned[column] / row[column]
        duals.multipliers[level, index] = multiplier * problem.weights[index]
        add_multiple(turned[base:column], multiplier, row[base:])


@part
def _add_active(A: Matrix, factor: Factor, duals: Duals, level: int, begin: int, end: int) -> None:
    """Add some active rows, times their multipliers of a level, to the gradient."""
    gradient, chosen, found = duals.gradient, duals.chosen, duals.multipliers[level]
    n, count = len(gradient), 0
    for place in range(begin, end):
        index = factor.order[place]
        if index < n:
            gradient[index] += found[index]
        elif found[index] != 0.0:
            chosen[count] = index - n
            count += 1
    add_rows(gradient, A, found, chosen, count, n)


@part
def _deactivate_above(
    rows: RowStates,
    factor: Factor,
    duals: Duals,
    state: State,
    level: int,
    above: int,
    size: float,
    ratio: float,
) -> int:
    """Deactivate rows above a level with a multiplier of the wrong sign; return their count."""
    found = duals.multipliers[level]
    for place in range(above):
        index = factor.order[place]
        size = max(size, abs(found[index]) * rows.norm[index])
    noise = FACTOR_TOLERANCE * size
    count, first, largest, most = 0, -1, -1, 0.0
    for place in range(above):
        index = factor.order[place]
        # Positive where it has the sign of its side.
        force = found[index] * rows.norm[index] * rows.side[index]
        if rows.sign_free[index] == 0 and force > noise:
            rows.needed_by[index] = 1 + min(level, len(factor.rank) - 1)
        if rows.sign_free[index] != 0 or not force < -noise:
            continue
        if rows.locked[index] == LOCKED:
            if force < -OPTIMALITY_TOLERANCE * size:
                state.doubtful = 1
            continue
        duals.chosen[count], duals.forces[count] = index, force
        count += 1
        if force < most:
            largest, most = index, force
        if first < 0 or index < first:
            first = index
    if count == 0:
        for place in range(above):
            index = factor.order[place]
            if abs(found[index]) * rows.norm[index] > noise:
                rows.sign_free[index] = 1
        return 0
    if ratio > 1.0:
        state.deactivated = first if ratio == FIRST else largest
        rows.side[state.deactivated] = 0
        if state.idle > 3 * PATIENCE:
            rows.locked[state.deactivated] = RELEASED
        return 1
    dropped = 0
    for i in range(count):
        if duals.forces[i] <= ratio * most:
            rows.side[duals.chosen[i]] = rows.sign_free[duals.chosen[i]] = 0
            dropped += 1
    return dropped


# --- optimality conditions ----------------------------------------------------------------------


@part
def is_optimal(problem: Problem, work: SearchWork) -> bool:
    """Check feasibility of the rows, stationarity of the levels and signs of the multipliers."""
    if work.state.doubtful != 0:
        return False
    factor, duals, norm = work.factor, work.duals, work.rows.norm
    levels, gradient = len(factor.rank), duals.gradient
    natural = _natural_reach(factor)
    reach = max(norm_of(work.points.x), natural)
    worst = _row_error(problem, work.rows, work.factor, work.points.values, reach)
    # A row is off by 2 worst |a| reach at most, and a level by so much for each of its rows.
    off = 2.0 * sqrt(len(norm)) * worst * reach
    work.state.unsettled = 0 if off <= OPTIMALITY_TOLERANCE * natural else 1
    for level in range(levels):
        if _slack_force(factor, level) != 0.0:
            gradient[:] = 0.0
            worst = max(worst, _imbalance(problem.A, norm, factor, duals, level, 0.0))
    size = 0.0
    for i in range(len(gradient)):
        size = max(size, abs(problem.g[i]), abs(problem.H[i, i]) * reach)
    copy(gradient, work.cost.gradient)
    worst = max(worst, _imbalance(problem.A, norm, factor, duals, levels, size))
    return bool(worst <= OPTIMALITY_TOLERANCE) and not _has_wrong_sign(work, reach)


@part
def _has_wrong_sign(work: SearchWork, reach: float) -> bool:
    """Return whether the first multiplier of a row beyond rounding has the wrong sign."""
    factor, rows, decided = work.factor, work.rows, work.duals.forces
    levels = len(factor.rank)
    active = factor.begin[levels]
    decided[:active] = 0.0
    for level in range(levels):
        if _slack_force(factor, level) == 0.0:
            continue
        found, size = work.duals.multipliers[level], 0.0
        for place in range(active):
            index = factor.order[place]
            size = max(size, abs(found[index]) * rows.norm[index])
        for place in range(active):
            index = factor.order[place]
            if rows.side[index] == EQUALITY or decided[place] != 0.0:
                continue
            force = found[index] * rows.norm[index] * rows.side[index]
            clear = abs(force) > OPTIMALITY_TOLERANCE * size
            if rows.level[index] == level:
                own = abs(factor.bound[place]) + factor.size[place] * reach
                clear = clear or abs(factor.slack[place]) > OPTIMALITY_TOLERANCE * own
            if clear and force < 0.0:
                return True
            decided[place] = 1.0 if clear else 0.0
    return False


@part
def _row_error(
    problem: Problem, rows: RowStates, factor: Factor, values: Vector, reach: float
) -> float:
    """Return the largest relative error of rows; inactive ones may lie inside their bounds."""
    worst = 0.0
    for place in range(factor.begin[len(factor.rank)]):
        index = factor.order[place]
        bound = factor.bound[place]
        miss = abs(values[index] * problem.weights[index] - bound - factor.slack[place])
        scale = abs(bound) + factor.size[place] * reach
        # Comparisons that fail on NaN.
        if not (miss < np.inf and abs(bound) < np.inf):
            return np.inf
        if miss > worst * scale:
            worst = miss / scale
    for i in range(len(values)):
        if rows.side[i] == 0:
            miss = max(values[i] - problem.upper[i], problem.lower[i] - values[i], 0.0)
            scale = rows.norm[i] * reach
            if not miss < np.inf:
                return np.inf
            if miss > worst * scale:
                worst = miss / scale if scale > 0.0 else np.inf
    return worst


@part
def _natural_reach(factor: Factor) -> float:
    """Return the largest distance to x that meets one active row alone."""
    reach = 0.0
    for place in range(factor.begin[len(factor.rank)]):
        if factor.size[place] > 0.0:
            reach = max(reach, abs(factor.bound[place]) / factor.size[place])
    return reach


@part
def _imbalance(
    A: Matrix, norm: Vector, factor: Factor, duals: Duals, level: int, size: float
) -> float:
    """Return the relative remainder of a level's gradient and its multipliers times the rows."""
    gradient, found = duals.gradient, duals.multipliers[level]
    active = factor.begin[len(factor.rank)]
    for place in range(active):
        index = factor.order[place]
        size = max(size, abs(found[index]) * norm[index])
    _add_active(A, factor, duals, level, 0, active)
    left = 0.0
    for j in range(len(gradient)):
        if not abs(gradient[j]) < np.inf:
            return np.inf
        left = max(left, abs(gradient[j]))
    return left / size if left > 0.0 else left


# --- strictness: no level gets worse once it has been solved --------------------------------------

# The coordinates of a level leave the levels above as they are, with two exceptions. A row that
# depends on those before it to within `RANK_TOLERANCE` has no coordinate, so that a long step below
# moves it nevertheless. And the rounding of a very long step moves every row.


@part
def find_moved(problem: Problem, work: SearchWork) -> int:
    """Return the first level whose residual changed after it was solved, or -1."""
    rows, factor, answer = work.rows, work.factor, work.answer
    if work.state.unsettled == 0:
        return -1
    lower, upper, weights = problem.lower, problem.upper, problem.weights
    values, level_of = work.points.values, rows.level
    measure_values(lower, upper, weights, level_of, values, answer.slacks, answer.residuals)
    sizes, reach = answer.target_residuals, _widest_reach(problem, factor)
    sizes[:] = 0.0
    for i in range(len(weights)):
        sizes[rows.level[i]] = max(sizes[rows.level[i]], rows.norm[i] * weights[i])
    for level in range(len(sizes)):
        square = 0.0
        for place in range(factor.begin[level], factor.begin[level + 1]):
            index = factor.order[place]
            slack = factor.slack[place] + rows.shift[index] * weights[index]
            square += slack * slack
        room = OPTIMALITY_TOLERANCE * sizes[level] * reach
        if not abs(answer.residuals[level] - sqrt(square)) <= room:
            return level
    return -1


@part
def guard(problem: Problem, work: SearchWork, level: int) -> bool:
    """Keep the remainder of a level's dependent rows, where it moved, from the levels below."""
    rows, factor, values = work.rows, work.factor, work.points.values
    reach, found = _widest_reach(problem, factor), False
    for place in range(factor.begin[level] + factor.rank[level], factor.begin[level + 1]):
        index = factor.order[place]
        moved = values[index] * problem.weights[index] - factor.bound[place] - factor.slack[place]
        room = OPTIMALITY_TOLERANCE * factor.size[place] * reach
        if rows.guarded[index] == 0 and abs(moved) > room:
            rows.guarded[index], rows.factored[index] = 1, UNKNOWN
            found = True
    return found


@part
def depends_on_rank(problem: Problem, work: SearchWork) -> bool:
    """Return whether a level would miss less if a nearly dependent row were independent.

    With equalities alone the same rows count as dependent however many levels follow. Inequalities
    that are active for a level below may take the remainder of a row, or leave more of it.
    """
    factor, level_of = work.factor, work.rows.level
    least = CANCELLATION * CANCELLATION
    for level in range(len(factor.rank)):
        for place in range(factor.begin[level] + factor.rank[level], factor.begin[level + 1]):
            if not factor.left[place] > least * factor.size[place] * factor.size[place]:
                continue
            room = OPTIMALITY_TOLERANCE * factor.size[place] * _widest_reach(problem, factor)
            if abs(factor.slack[place]) > room:
                for i in range(len(level_of)):
                    bounded = problem.lower[i] > -np.inf or problem.upper[i] < np.inf
                    if level_of[i] <= level and bounded and problem.lower[i] < problem.upper[i]:
                        return True
    return False


@part
def _widest_reach(problem: Problem, factor: Factor) -> float:
    """Return the largest distance that one active row, or the final cost, alone takes x."""
    slope = curvature = 0.0
    for i in range(len(problem.g)):
        slope, curvature = max(slope, abs(problem.g[i])), max(curvature, abs(problem.H[i, i]))
    return max(_natural_reach(factor), slope / curvature if curvature > 0.0 else 0.0)
