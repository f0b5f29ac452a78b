"""A guess of the active set, level by level, by a dual active-set method with penalties.

Every row may be violated at a price: high for the level at hand, and so much higher for those above
that they hardly ever are. So no row is impossible, and a step adds one row at the cost of a product
of matrix and vector. With the final cost's H = C C^T and rows M_i = C^-1 a_i,
the active rows' multipliers solve

    (M M^T + D) lambda = a x_0 - b,    x = x_0 - H^-1 A^T lambda,    a x = b + D lambda,

where x_0 = -H^-1 g and D is the compliance of the rows, the inverse of their penalties.

Where all multipliers of the active rows have the right sign, the row that is violated most becomes
active, and its own multiplier grows from zero. Where another's changes its sign on the way, that
row is deactivated, and the step goes on from there (Goldfarb, Idnani 1983).

Double precision does not allow penalties so high that D lambda is negligible. So the same rows are
solved again with bounds moved by -D lambda, as in the method of multipliers (Hestenes 1969,
"Multiplier and gradient methods"). That removes the slack of a level that can be met. If slack
stays, the levels above alone are corrected until they are met; the level keeps its D lambda.
"""

from math import sqrt

from poise._compiled import part
from poise.hqp._active_set.kernels import norm_of
from poise.hqp._active_set.penalties import (
    add_row,
    deactivate,
    find_multipliers,
    find_point,
    prepare_rows,
    solve_rhs,
)
from poise.hqp._active_set.workspace import (
    EQUALITY,
    UNKNOWN,
    Penalties,
    Problem,
    SearchWork,
    Vector,
)
from poise.hqp._tolerances import (
    CORRECTIONS,
    GUESS_SLACK_TOLERANCE,
    GUESS_TOLERANCE,
    HARD,
    HOLDING_RATIO,
    SOFT,
    UNMET_RATIO,
)

_ALL_LEVELS = -1
"""For `_correct`: bounds of all levels move."""


@part
def guess(problem: Problem, work: SearchWork) -> None:
    """Choose the sides of all rows anew."""
    guessed = work.guessed
    prepare_rows(problem, guessed, work.duals.chosen, work.rows.shift)
    count = unchanged = 0
    for level in range(len(problem.damping)):
        if not _soften(problem.weights, guessed, level):
            continue
        count = _activate_needed(guessed, level, count)
        solve_rhs(guessed, unchanged)
        for place in range(unchanged, count):
            add_row(guessed, place)
        count = _activate_violated(guessed, level, _deactivate_wrong(guessed, count))
        slack = _find_slack(problem.weights, guessed, level, count)
        if slack > 0.0:
            count = _activate_violated(guessed, level, _correct(guessed, _ALL_LEVELS, count))
            if _find_slack(problem.weights, guessed, level, count) > UNMET_RATIO * slack:
                for _ in range(CORRECTIONS):
                    count = _activate_violated(guessed, level, _correct(guessed, level, count))
        unchanged = _hold(problem.weights, guessed, level, count)
    for i in range(len(guessed.side)):
        work.rows.factored[i], guessed.sign_free[i] = UNKNOWN, 0
        if problem.lower[i] == problem.upper[i]:
            guessed.side[i], guessed.sign_free[i] = EQUALITY, 1


# --- the levels -------------------------------------------------------------------------------


@part
def _soften(weights: Vector, guessed: Penalties, level: int) -> bool:
    """Set D of the rows of the level at hand; return whether it has any."""
    total, count = 0.0, 0
    for i in range(len(guessed.level)):
        if guessed.level[i] == level:
            size = guessed.norm[i] * weights[i]
            total += size * size
            count += 1 if size > 0.0 else 0
    if count == 0:
        return False
    for i in range(len(guessed.level)):
        if guessed.level[i] == level:
            weight = weights[i]
            guessed.compliance[i] = SOFT * total / (count * weight * weight)
    return True


@part
def _activate_needed(guessed: Penalties, level: int, count: int) -> int:
    """Activate equalities of the level and rows that it needed; return the active rows' count."""
    for i in range(len(guessed.level)):
        if guessed.level[i] > level or guessed.side[i] != 0 or not guessed.norm[i] > 0.0:
            continue
        if count == len(guessed.G):
            break
        if guessed.level[i] == level and guessed.lower[i] == guessed.upper[i]:
            guessed.side[i], guessed.sign_free[i] = EQUALITY, 1
        elif abs(guessed.needed_by[i]) == level + 1:
            guessed.side[i] = 1 if guessed.needed_by[i] > 0 else -1
            guessed.sign_free[i] = 0
        else:
            continue
        guessed.order[count] = i
        count += 1
    return count


@part
def _correct(guessed: Penalties, level: int, count: int) -> int:
    """Move bounds by -D lambda, but not a level's own; return the active rows' count."""
    for k in range(count):
        i = guessed.order[k]
        guessed.moved[i] = guessed.held[i]
        if guessed.level[i] != level:
            guessed.moved[i] -= guessed.compliance[i] * guessed.multiplier[k]
    solve_rhs(guessed, count)
    return _deactivate_wrong(guessed, count)


@part
def _hold(weights: Vector, guessed: Penalties, level: int, count: int) -> int:
    """Hold a level's optimum; return the count of rows whose compliance stays.

    Where a level has slack, its rows and those that oppose them stay active.
    """
    slack, most = _find_slack(weights, guessed, level, count), 0.0
    if slack > 0.0:
        for k in range(count):
            i = guessed.order[k]
            if guessed.level[i] == level:
                most = max(most, abs(guessed.multiplier[k]) * guessed.norm[i])
        for k in range(count):
            i = guessed.order[k]
            if abs(guessed.multiplier[k]) * guessed.norm[i] > HOLDING_RATIO * most:
                guessed.sign_free[i] = 1
            if guessed.level[i] == level:
                guessed.held[i] = _missed(guessed, k)
                if abs(guessed.held[i]) * weights[i] > HOLDING_RATIO * slack:
                    guessed.sign_free[i] = 1
    for i in range(len(guessed.level)):
        if guessed.level[i] == level:
            guessed.compliance[i] = HARD * guessed.norm[i] * guessed.norm[i]
    unchanged = count
    for k in range(count - 1, -1, -1):
        i = guessed.order[k]
        guessed.moved[i] = guessed.held[i] - guessed.compliance[i] * guessed.multiplier[k]
        if guessed.level[i] == level:
            unchanged = k
    return unchanged


@part
def _find_slack(weights: Vector, guessed: Penalties, level: int, count: int) -> float:
    """Return the weighted slack of a level's active rows, or zero for rounding."""
    square = size = 0.0
    for k in range(count):
        i = guessed.order[k]
        if guessed.level[i] == level:
            missed = _missed(guessed, k) * weights[i]
            square += missed * missed
            size = max(size, guessed.norm[i] * weights[i])
    slack = sqrt(square)
    return slack if slack > GUESS_SLACK_TOLERANCE * size * norm_of(guessed.y) else 0.0


@part
def _missed(guessed: Penalties, place: int) -> float:
    """Return the distance of an active row from its bound."""
    i = guessed.order[place]
    return float(guessed.moved[i] + guessed.compliance[i] * guessed.multiplier[place])


# --- the dual active-set method ---------------------------------------------------------------


@part
def _activate_violated(guessed: Penalties, level: int, count: int) -> int:
    """Activate rows down to a level until none is violated; return the active rows' count."""
    for _ in range(2 * len(guessed.side)):
        find_point(guessed, count)
        index = _find_most_violated(guessed, level)
        if index < 0 or count == len(guessed.G):
            break
        count = _activate(guessed, index, count)
    return count


@part
def _deactivate_wrong(guessed: Penalties, count: int) -> int:
    """Deactivate rows until no multiplier has the wrong sign; return the active rows' count."""
    wrong = True
    while wrong:
        wrong = False
        find_multipliers(guessed, count, guessed.multiplier)
        for k in range(count - 1, -1, -1):
            row = guessed.order[k]
            if guessed.sign_free[row] == 0 and guessed.multiplier[k] * guessed.side[row] < 0.0:
                deactivate(guessed, k, count)
                count, wrong = count - 1, True
    return count


@part
def _find_most_violated(guessed: Penalties, level: int) -> int:
    """Return the inactive row down to a level most violated relative to its norm, or -1."""
    most, worst = GUESS_TOLERANCE * norm_of(guessed.y), -1
    for i in range(len(guessed.level)):
        if guessed.side[i] != 0 or guessed.level[i] > level or not guessed.norm[i] > 0.0:
            continue
        value = guessed.values[i]
        over = max(value - guessed.upper[i], guessed.lower[i] - value)
        if over > most * guessed.norm[i]:
            worst, most = i, over / guessed.norm[i]
    return worst


@part
def _activate(guessed: Penalties, index: int, count: int) -> int:
    """Activate a violated row; return the active rows' count."""
    guessed.side[index] = 1 if guessed.values[index] > guessed.upper[index] else -1
    guessed.order[count] = index
    guessed.multiplier[count] = 0.0
    add_row(guessed, count)
    count += 1
    while True:
        find_multipliers(guessed, count, guessed.next_multiplier)
        length, blocking = 1.0, -1
        for k in range(count):
            row, now, then = guessed.order[k], guessed.multiplier[k], guessed.next_multiplier[k]
            if guessed.sign_free[row] != 0 or row == index or not then * guessed.side[row] < 0.0:
                continue
            ratio = now / (now - then)
            if ratio < length:
                length, blocking = ratio, k
        for k in range(count):
            guessed.multiplier[k] += length * (guessed.next_multiplier[k] - guessed.multiplier[k])
        if blocking < 0:
            return count
        deactivate(guessed, blocking, count)
        count -= 1
