"""A guess of the active set, level by level, by a dual active-set method with penalties.

Every row may be violated at a price: high for the level at hand, and so much higher for those above
that they hardly ever are. So no row is impossible, and a step adds one row at the cost of a product
of matrix and vector. With the final cost's H = C C^T and rows M_i = C^-1 a_i,
the active rows' multipliers solve

    (M M^T + D) lambda = a x_0 - b,    x = x_0 - H^-1 A^T lambda,    a x = b + D lambda,

where x_0 = -H^-1 g and D is the compliance of the rows, the inverse of their penalties.

Where all multipliers of the active rows have the right sign, the row that is violated most becomes
active, and its own multiplier grows from zero. Where another one changes sign before the full
step, that row is deactivated, and the step continues from there (Goldfarb, Idnani 1983).

Double precision does not allow penalties so high that D lambda is negligible. So the same rows are
solved again with bounds moved by -D lambda, as in the method of multipliers (Hestenes 1969,
"Multiplier and gradient methods"). That removes the slack of a level that can be met. If slack
stays, the levels above alone are corrected until they are met; the level keeps its D lambda.
"""

from math import hypot, sqrt

from poise._compiled import part
from poise.hqp._active_set.kernels import (
    add_multiple,
    choose_nonzero,
    copy,
    dot,
    minus_dot,
    norm_of,
)
from poise.hqp._active_set.workspace import (
    EQUALITY,
    UNKNOWN,
    Indices,
    Matrix,
    Penalties,
    Problem,
    SearchWork,
    Vector,
)
from poise.hqp._tolerances import (
    COARSE,
    FLOOR,
    HARD,
    MET_TOLERANCE,
    OPTIMALITY_TOLERANCE,
    RANK_TOLERANCE,
    SOFT,
    UNMET_RATIO,
)

_ALL_LEVELS = -1
"""For `_correct`: bounds of all levels move."""


@part
def guess(problem: Problem, work: SearchWork) -> None:
    """Choose the active bounds of all rows again."""
    guessed = work.guessed
    _prepare_rows(problem, guessed, work.duals.chosen, work.rows.shift)
    count = unchanged = 0
    for level in range(len(problem.damping)):
        if not _soften(problem.weights, guessed, level):
            continue
        count = _activate_needed(guessed, level, count)
        _solve_rhs(guessed, unchanged)
        for place in range(unchanged, count):
            _add_row(guessed, place)
        count = _activate_violated(guessed, level, _deactivate_wrong(guessed, count))
        slack = _find_slack(problem.weights, guessed, level, count)
        if slack > 0.0:
            count = _activate_violated(guessed, level, _correct(guessed, _ALL_LEVELS, count))
            if _find_slack(problem.weights, guessed, level, count) > UNMET_RATIO * slack:
                for _ in range(2):
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
    _solve_rhs(guessed, count)
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
            if abs(guessed.multiplier[k]) * guessed.norm[i] > OPTIMALITY_TOLERANCE * most:
                guessed.sign_free[i] = 1
            if guessed.level[i] == level:
                guessed.held[i] = _missed(guessed, k)
                if abs(guessed.held[i]) * weights[i] > OPTIMALITY_TOLERANCE * slack:
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
    return slack if slack > COARSE * size * norm_of(guessed.y) else 0.0


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
        _find_point(guessed, count)
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
        _find_multipliers(guessed, count, guessed.multiplier)
        for k in range(count - 1, -1, -1):
            row = guessed.order[k]
            if guessed.sign_free[row] == 0 and guessed.multiplier[k] * guessed.side[row] < 0.0:
                _deactivate(guessed, k, count)
                count, wrong = count - 1, True
    return count


@part
def _find_most_violated(guessed: Penalties, level: int) -> int:
    """Return the inactive row down to a level most violated relative to its norm, or -1."""
    most, worst = MET_TOLERANCE * norm_of(guessed.y), -1
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
    _add_row(guessed, count)
    count += 1
    while True:
        _find_multipliers(guessed, count, guessed.next_multiplier)
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


# --- the system (M M^T + D) lambda = a x_0 - b ----------------------------------------------------


@part
def _prepare_rows(problem: Problem, guessed: Penalties, chosen: Indices, shift: Vector) -> None:
    """Find C, all rows M with their norms, and the rows' values at x_0; no row is active."""
    (m, n), M = problem.A.shape, guessed.M
    _factor_cost(problem.H, guessed.C, chosen)
    for i in range(n):
        _invert(guessed.C, chosen, i, M[i])
    for i in range(m):
        row = M[n + i]
        row[:] = 0.0
        _add_combination(row, M, problem.A[i], chosen)
    z = guessed.y
    z[:] = 0.0
    _add_combination(z, M, problem.g, chosen)
    for i in range(n + m):
        # a x_0 = -M C^-1 g.
        guessed.norm[i], guessed.start[i] = norm_of(M[i]), minus_dot(0.0, M[i], z)
        guessed.lower[i], guessed.upper[i] = problem.lower[i], problem.upper[i]
        side = guessed.side[i] if guessed.side[i] != EQUALITY else 0
        needed_by = guessed.needed_by[i]
        guessed.needed_by[i] = side * (needed_by if needed_by > 0 else len(problem.damping))
        guessed.side[i] = guessed.sign_free[i] = 0
        guessed.moved[i] = guessed.held[i] = shift[i]


@part
def _factor_cost(H: Matrix, C: Matrix, begin: Indices) -> None:
    """Factor H plus a ridge; its rows and those of C, often a few blocks, begin at `begin`."""
    n, trace = len(H), 0.0
    for i in range(n):
        trace += H[i, i]
        begin[i] = 0
        while begin[i] < i and H[i, begin[i]] == 0.0:
            begin[i] += 1
    ridge = RANK_TOLERANCE * trace / n if trace > 0.0 else 1.0
    for i in range(n):
        row = C[i]
        for j in range(begin[i], i + 1):
            start, total = max(begin[i], begin[j]), H[i, j] + (ridge if i == j else 0.0)
            total = minus_dot(total, row[start:j], C[j, start:j])
            row[j] = sqrt(max(total, ridge)) if i == j else total / C[j, j]


@part
def _invert(C: Matrix, begin: Indices, index: int, column: Vector) -> None:
    """Find a column of C^-1."""
    column[:] = 0.0
    for k in range(index, len(column)):
        start = max(index, begin[k])
        total = minus_dot(1.0 if k == index else 0.0, C[k, start:k], column[start:k])
        column[k] = total / C[k, k]


@part
def _add_combination(total: Vector, M: Matrix, factors: Vector, chosen: Indices) -> None:
    """Add C^-1 times a vector of mostly zeros, four columns at a time as in `add_rows`."""
    n, count, i = len(factors), choose_nonzero(factors, chosen), 0
    while i + 4 <= count:
        a, b, c, d = chosen[i], chosen[i + 1], chosen[i + 2], chosen[i + 3]
        # Columns of C^-1 begin at the diagonal.
        m_a, m_b, m_c, m_d, out = M[a, a:], M[b, a:], M[c, a:], M[d, a:], total[a:]
        f_a, f_b, f_c, f_d = factors[a], factors[b], factors[c], factors[d]
        for j in range(n - a):
            out[j] += f_a * m_a[j] + f_b * m_b[j] + f_c * m_c[j] + f_d * m_d[j]
        i += 4
    while i < count:
        a = chosen[i]
        add_multiple(total[a:], factors[a], M[a, a:])
        i += 1


@part
def _add_row(guessed: Penalties, place: int) -> None:
    """Factor one more row of the system, which stands at a place in `order`."""
    index = guessed.order[place]
    row, M = guessed.G[place], guessed.M[index]
    right = _right(guessed, place)
    square = guessed.norm[index] * guessed.norm[index]
    left = square + guessed.compliance[index]
    for k in range(place):
        other, product = guessed.G[k], dot(M, guessed.M[guessed.order[k]])
        row[k] = minus_dot(product, row[:k], other) / other[k]
        left -= row[k] * row[k]
        right -= row[k] * guessed.rhs[k]
    row[place] = sqrt(max(left, FLOOR * square))
    guessed.rhs[place] = right / row[place]


@part
def _solve_rhs(guessed: Penalties, count: int) -> None:
    """Solve with the factor again, for moved bounds."""
    for k in range(count):
        row = guessed.G[k]
        guessed.rhs[k] = minus_dot(_right(guessed, k), guessed.rhs[:k], row) / row[k]


@part
def _right(guessed: Penalties, place: int) -> float:
    index = guessed.order[place]
    bound = guessed.upper[index] if guessed.side[index] > 0 else guessed.lower[index]
    return float(guessed.start[index] - bound - guessed.moved[index])


@part
def _deactivate(guessed: Penalties, place: int, count: int) -> None:
    """Take a row out of the system and out of `order`; rotations mend the factor."""
    G, rhs, index = guessed.G, guessed.rhs, guessed.order[place]
    guessed.side[index], guessed.moved[index] = 0, guessed.held[index]
    for k in range(place, count - 1):
        guessed.order[k], guessed.multiplier[k] = guessed.order[k + 1], guessed.multiplier[k + 1]
        copy(G[k, : k + 2], G[k + 1])
    for k in range(place, count - 1):
        length = hypot(G[k, k], G[k, k + 1])
        c, s = G[k, k] / length, G[k, k + 1] / length
        for i in range(k, count - 1):
            a, b = G[i, k], G[i, k + 1]
            G[i, k], G[i, k + 1] = c * a + s * b, c * b - s * a
        a, b = rhs[k], rhs[k + 1]
        rhs[k], rhs[k + 1] = c * a + s * b, c * b - s * a


@part
def _find_multipliers(guessed: Penalties, count: int, out: Vector) -> None:
    """Find the multipliers of the first rows of `order`."""
    copy(out[:count], guessed.rhs)
    for k in range(count - 1, -1, -1):
        out[k] /= guessed.G[k, k]
        add_multiple(out[:k], -out[k], guessed.G[k])


@part
def _find_point(guessed: Penalties, count: int) -> None:
    """Find y = C^T (x_0 - x) and the values of all rows, from the multipliers."""
    guessed.y[:] = 0.0
    for k in range(count):
        add_multiple(guessed.y, guessed.multiplier[k], guessed.M[guessed.order[k]])
    for i in range(len(guessed.M)):
        guessed.values[i] = minus_dot(guessed.start[i], guessed.y, guessed.M[i])
