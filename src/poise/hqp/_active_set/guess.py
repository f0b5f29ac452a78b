"""A guess of the active set, level by level, by a dual active-set method with penalties.

Every row may be violated at a price: high for the level at hand, and so much higher for those above
that they hardly ever are. Then no row can be impossible, and a step adds one row, which costs as
little as a product of matrix and vector. With the final cost's H = C C^T and rows M_i = C^-1 a_i,
the active rows' multipliers solve

    (M M^T + D) lambda = a x_0 - b,    x = x_0 - H^-1 A^T lambda,    a x = b + D lambda,

where x_0 = -H^-1 g and D is the compliance of the rows, the inverse of their penalties.

Where all multipliers of the active rows have the right sign, the row that is violated most becomes
active, and its own multiplier grows from zero. Where another's changes its sign on the way, that
row is deactivated, and the step goes on from there (Goldfarb, Idnani 1983).

Numbers have no room for penalties so high that D lambda can be forgotten. So it is taken back: with
bounds moved by -D lambda the same rows are solved again, as in the method of multipliers (Hestenes
1969, "Multiplier and gradient methods"). If the level at hand can be met, its slack is gone after
that. If not, it stays, and then only the levels above are corrected until they are met; for the
level itself D lambda is what the others leave it.
"""

from math import sqrt

from poise._compiled import part
from poise.hqp._active_set.penalties import (
    add_row,
    find_multipliers,
    find_point,
    prepare_rows,
    refactor,
    remove_row,
    solve_rhs,
)
from poise.hqp._active_set.workspace import (
    EQUALITY,
    UNKNOWN,
    Penalties,
    Problem,
    Vector,
    Work,
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
"""Instead of a level that bounds are not moved for."""


@part
def guess(problem: Problem, work: Work) -> None:
    """Chooses the sides of all rows anew."""
    guessed = work.guessed
    prepare_rows(problem, guessed, work.duals.chosen, work.rows.shift)
    count = unchanged = 0
    for level in range(len(problem.damping)):
        if not _soften(problem.weights, guessed, level):
            continue
        count = _activate_needed(guessed, level, count)
        refactor(guessed, unchanged, count)
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
    """Sets D of a level's rows while it is at hand; returns whether it has any."""
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
    """Makes rows active that are the level's equalities or were needed by it; how many are then."""
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
    """Moves bounds by -D lambda, but not a level's own; returns how many rows stay active."""
    for k in range(count):
        i = guessed.order[k]
        guessed.moved[i] = guessed.held[i]
        if guessed.level[i] != level:
            guessed.moved[i] -= guessed.compliance[i] * guessed.multiplier[k]
    solve_rhs(guessed, count)
    return _deactivate_wrong(guessed, count)


@part
def _hold(weights: Vector, guessed: Penalties, level: int, count: int) -> int:
    """Holds what a level reached; returns how many rows keep the compliance they had.

    Where a level has slack, its rows and those that hold it up stay active.
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
    """What a level's active rows miss, weighted; zero where that is next to nothing."""
    square = size = reach = 0.0
    for j in range(len(guessed.y)):
        reach += guessed.y[j] * guessed.y[j]
    for k in range(count):
        i = guessed.order[k]
        if guessed.level[i] == level:
            missed = _missed(guessed, k) * weights[i]
            square += missed * missed
            size = max(size, guessed.norm[i] * weights[i])
    slack = sqrt(square)
    return slack if slack > GUESS_SLACK_TOLERANCE * size * sqrt(reach) else 0.0


@part
def _missed(guessed: Penalties, place: int) -> float:
    """How far an active row is from its bound."""
    i = guessed.order[place]
    return float(guessed.moved[i] + guessed.compliance[i] * guessed.multiplier[place])


# --- the dual active-set method ---------------------------------------------------------------


@part
def _activate_violated(guessed: Penalties, level: int, count: int) -> int:
    """Activates rows down to a level until none is violated; returns how many are active then."""
    for _ in range(2 * len(guessed.side)):
        find_point(guessed, count)
        index = _find_most_violated(guessed, level)
        if index < 0 or count == len(guessed.G):
            break
        count = _activate(guessed, index, count)
    return count


@part
def _deactivate_wrong(guessed: Penalties, count: int) -> int:
    """Deactivates rows until no multiplier has the wrong sign; returns how many are left."""
    wrong = True
    while wrong:
        wrong = False
        find_multipliers(guessed, count, guessed.multiplier)
        for k in range(count - 1, -1, -1):
            row = guessed.order[k]
            if guessed.sign_free[row] == 0 and guessed.multiplier[k] * guessed.side[row] < 0.0:
                _deactivate(guessed, k, count)
                count, wrong = count - 1, True
    return count


@part
def _find_most_violated(guessed: Penalties, level: int) -> int:
    """The inactive row down to a level that is violated most, relative to its norm; or -1."""
    most, worst = 0.0, -1
    for j in range(len(guessed.y)):
        most += guessed.y[j] * guessed.y[j]
    most = GUESS_TOLERANCE * sqrt(most)
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
    """Makes a violated row active; returns how many are active then."""
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
        _deactivate(guessed, blocking, count)
        count -= 1


@part
def _deactivate(guessed: Penalties, place: int, count: int) -> None:
    """Makes an active row inactive."""
    row = guessed.order[place]
    guessed.side[row] = 0
    guessed.moved[row] = guessed.held[row]
    remove_row(guessed, place, count)
