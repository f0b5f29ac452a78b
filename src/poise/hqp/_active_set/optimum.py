"""The lexicographic optimum of an active set: its rows are equalities, all others are left out.

The factorisation turns the coordinates, x = Q y, so that each level's rows become a trapezoid in y:
zero to the right of the coordinates that it and the levels above it take. So the levels are solved
one after the other, and a level's own coordinates leave those above as they are.

A level with more rows than coordinates are left is multiplied by the columns of Q of these, which
takes less than to reflect its rows; so are the levels after it. Of their rows the part along the
coordinates before is not formed: their bounds and multipliers take it from the rows in x.
"""

from math import sqrt

from poise._compiled import part
from poise.hqp._active_set.kernels import (
    add_multiple,
    add_rows,
    choose_nonzero,
    copy,
    dot,
    make_reflection,
    minus_dot,
    multiply,
    norm_of,
    reflect,
    reflect_rows,
    reflect_rows_by_all,
)
from poise.hqp._active_set.least_squares import find_slacks_of_conflict, solve_damped
from poise.hqp._active_set.workspace import (
    EQUALITY,
    Factor,
    FinalCost,
    Indices,
    LeastSquares,
    Matrix,
    Problem,
    RowStates,
    SearchWork,
    Vector,
)
from poise.hqp._tolerances import (
    CANCELLATION,
    CANCELLED,
    COARSE,
    RANK_TOLERANCE,
    SLACK_TOLERANCE,
)

_SIGN_FREE = 8
"""Added to the side of a row whose sign is free, in `RowStates.factored`."""


@part
def find_optimum(problem: Problem, work: SearchWork) -> None:
    """Factor the active rows and find their optimum."""
    factor, target = work.factor, work.points.target
    n, levels = len(target), len(factor.rank)
    start = _first_changed(work.rows, levels)
    if work.state.changes == 1:
        start = 0
    factor.begin[0] = factor.first[0] = 0
    for level in range(start, levels):
        _factor_level(problem, work, level)
        _solve_level(problem, factor, work.squares, level)
    taken = factor.first[levels]
    work.state.free = n - taken
    factor.y[taken:] = 0.0
    if factor.whole == levels:
        _make_basis(factor, work.cost.Z, taken)
    base, turned = factor.first[factor.whole], work.duals.turned
    copy(turned, factor.y)
    for k in range(taken - 1, base - 1, -1):
        reflect(turned[k:], factor.V[k, k:], factor.tau[k])
    for i in range(n):
        target[i] = factor.above[i] + dot(turned[base:], factor.Q[i, base:])
    if taken < n:
        _solve_cost(problem, factor, work.cost, target, work.duals.chosen)


@part
def _first_changed(rows: RowStates, levels: int) -> int:
    """Return the first level whose active rows are not as they were factored, and note them."""
    first = levels
    for i in range(len(rows.side)):
        now = 0 if rows.side[i] == 0 else rows.side[i] + _SIGN_FREE * rows.sign_free[i]
        if rows.factored[i] != now:
            rows.factored[i] = now
            first = min(first, rows.level[i])
    return first


# --- the factorisation ------------------------------------------------------------------------


@part
def _factor_level(problem: Problem, work: SearchWork, level: int) -> None:
    """Turn the coordinates that the levels above leave until a level's rows are a trapezoid."""
    rows, factor = work.rows, work.factor
    n, R = len(factor.y), factor.R
    begin, first = factor.begin[level], factor.first[level]
    free = _gather(problem, rows, factor, level, begin, 1)
    end = _gather(problem, rows, factor, level, free, 0)
    factor.begin[level + 1] = end
    if level <= factor.whole:
        factor.whole = len(factor.rank)
        if _basis_pays(n, end - begin, first):
            factor.whole = level
            _make_basis(factor, work.cost.Z, first)
    if level < factor.whole:
        reflect_rows_by_all(R, begin, end, factor.V, factor.tau, 0, first, 1)
    else:
        _multiply_by_basis(factor, work.duals.chosen, begin, end)
        base = factor.first[factor.whole]
        reflect_rows_by_all(R, begin, end, factor.V, factor.tau, base, first, 1)
    for row in range(begin, end):
        factor.left[row] = factor.left_exact[row] = dot(R[row, first:], R[row, first:])
    column, pivot = first, begin
    # Rows whose sign is free come first, so that no other row has to balance for them.
    for stop in (free, end):
        while pivot < stop and column < n:
            best = _best_pivot(factor, pivot, stop)
            if best < 0:
                break
            _take_coordinate(factor, best, pivot, end, column)
            column += 1
            pivot += 1
            _update_left(factor, pivot, end, column)
    factor.rank[level] = column - first
    # Guarded rows take a coordinate for what little of them lies outside the pivots.
    for place in range(pivot, end):
        if rows.guarded[factor.order[place]] == 0 or column == n:
            continue
        if norm_of(R[place, column:]) > CANCELLATION * factor.size[place]:
            _take_coordinate(factor, place, pivot, end, column)
            column, pivot = column + 1, pivot + 1
    factor.first[level + 1] = column


@part
def _basis_pays(n: int, rows: int, first: int) -> bool:
    """Compare the operations of both ways; those of a basis include two more vectors to turn."""
    free, each = n - first, 2 * first * (2 * n - first)
    return rows * each > (free + 2) * each + rows * 2 * n * free


@part
def _make_basis(factor: Factor, Z: Matrix, base: int) -> None:
    """Find the columns of Q from a coordinate on, and the point of the coordinates before it."""
    n, above = len(Z), factor.above
    free = n - base
    Z[:free] = 0.0
    for k in range(free):
        Z[k, base + k] = 1.0
    reflect_rows_by_all(Z, 0, free, factor.V, factor.tau, 0, base, -1)
    for j in range(n):
        factor.Q[j, :base] = 0.0
        for k in range(free):
            factor.Q[j, base + k] = Z[k, j]
    copy(above[:base], factor.y)
    above[base:] = 0.0
    for k in range(base - 1, -1, -1):
        reflect(above[k:], factor.V[k, k:], factor.tau[k])


@part
def _multiply_by_basis(factor: Factor, chosen: Indices, begin: int, end: int) -> None:
    """Replace rows by their products with the columns of Q in `factor`."""
    product = factor.rhs[: len(factor.y)]
    for place in range(begin, end):
        row = factor.R[place]
        product[:] = 0.0
        add_rows(product, factor.Q, row, chosen, choose_nonzero(row, chosen), 0)
        copy(row, product)


@part
def _take_coordinate(factor: Factor, place: int, pivot: int, end: int, column: int) -> None:
    """Make a row the next pivot, and reflect it and those after it."""
    if place != pivot:
        row_a, row_b = factor.R[place], factor.R[pivot]
        for j in range(len(row_a)):
            row_a[j], row_b[j] = row_b[j], row_a[j]
        factor.order[place], factor.order[pivot] = factor.order[pivot], factor.order[place]
        _swap(factor.bound, place, pivot)
        _swap(factor.size, place, pivot)
        _swap(factor.left, place, pivot)
        _swap(factor.left_exact, place, pivot)
    v = factor.V[column, column:]
    factor.tau[column] = make_reflection(factor.R[pivot, column:], v)
    reflect_rows(factor.R, pivot + 1, end, column, v, factor.tau[column])


@part
def _swap(numbers: Vector, a: int, b: int) -> None:
    numbers[a], numbers[b] = numbers[b], numbers[a]


@part
def _gather(
    problem: Problem, rows: RowStates, factor: Factor, level: int, place: int, sign_free: int
) -> int:
    """Copy a level's active rows, times their weights; return the next free place."""
    n = len(factor.y)
    if problem.bounds_level == level:
        for i in range(n):
            if rows.side[i] != 0 and rows.sign_free[i] == sign_free:
                factor.R[place, :] = 0.0
                factor.R[place, i] = problem.weights[i]
                place = _note(problem, rows, factor, i, place)
    for i in range(problem.starts[level], problem.starts[level + 1]):
        if rows.side[n + i] != 0 and rows.sign_free[n + i] == sign_free:
            weight = problem.weights[n + i]
            source, row = problem.A[i], factor.R[place]
            for j in range(n):
                row[j] = source[j] * weight
            place = _note(problem, rows, factor, n + i, place)
    return place


@part
def _note(problem: Problem, rows: RowStates, factor: Factor, index: int, place: int) -> int:
    """Note which row stands at a place; return the next place."""
    weight = problem.weights[index]
    bound = problem.upper[index] if rows.side[index] > 0 else problem.lower[index]
    factor.order[place] = index
    factor.bound[place] = (bound + rows.shift[index]) * weight
    factor.size[place] = rows.norm[index] * weight
    return place + 1


@part
def _best_pivot(factor: Factor, begin: int, end: int) -> int:
    """Return the row with most left by its size, or -1; the others get small coefficients so."""
    best, most, own = -1, 0.0, 1.0
    for row in range(begin, end):
        left, size = factor.left[row], factor.size[row]
        if left * own > most * size and left > RANK_TOLERANCE * RANK_TOLERANCE * size * size:
            best, most, own = row, left, size
    return best


@part
def _update_left(factor: Factor, begin: int, end: int, column: int) -> None:
    """Subtract the last pivot's part of each row from the part left of it."""
    for row in range(begin, end):
        seen = factor.R[row, column - 1]
        left = factor.left[row] - seen * seen
        if left < CANCELLED * factor.left_exact[row]:
            left = dot(factor.R[row, column:], factor.R[row, column:])
            factor.left_exact[row] = left
        factor.left[row] = left


# --- the levels -------------------------------------------------------------------------------


@part
def _solve_level(problem: Problem, factor: Factor, squares: LeastSquares, level: int) -> None:
    """Find the coordinates and the least slack of a level."""
    begin, end = factor.begin[level], factor.begin[level + 1]
    first, rank = factor.first[level], factor.rank[level]
    y, rhs, slack = factor.y, factor.rhs, factor.slack
    z = y[first : first + rank]
    _find_rhs(problem, factor, level)
    slack[begin:end] = 0.0
    _solve_pivots(factor, begin, first, rank)
    size, met = norm_of(y[: first + rank]), True
    for row in range(begin + rank, end):
        left = minus_dot(rhs[row], z, factor.R[row, first : first + rank])
        if abs(left) > SLACK_TOLERANCE * (abs(factor.bound[row]) + factor.size[row] * size):
            slack[row], met = -left, False
    y[first + rank : factor.first[level + 1]] = 0.0
    if not met and rank > 0:
        find_slacks_of_conflict(factor, squares, level)
        for row in range(begin, begin + rank):
            rhs[row] += slack[row]
        _solve_pivots(factor, begin, first, rank)
        _write_out_guarded(factor, level)


@part
def _find_rhs(problem: Problem, factor: Factor, level: int) -> None:
    """Find the bounds of a level's active rows less the part of the levels above."""
    n, first = len(factor.y), factor.first[level]
    base = 0 if level < factor.whole else factor.first[factor.whole]
    turned = factor.y[base:first]
    for row in range(factor.begin[level], factor.begin[level + 1]):
        left = minus_dot(factor.bound[row], turned, factor.R[row, base:])
        if base > 0:
            index = factor.order[row]
            own = index - n
            value = factor.above[index] if own < 0 else dot(factor.above, problem.A[own])
            left -= problem.weights[index] * value
        factor.rhs[row] = left


@part
def _solve_pivots(factor: Factor, begin: int, first: int, rank: int) -> None:
    """Meet a level's pivots, one after the other."""
    z = factor.y[first : first + rank]
    for k in range(rank):
        own = factor.R[begin + k, first : first + rank]
        z[k] = minus_dot(factor.rhs[begin + k], z[:k], own) / own[k]


@part
def _write_out_guarded(factor: Factor, level: int) -> None:
    """Turn guarded rows, which the least squares wrote in terms of the pivots, back into rows."""
    begin, first, rank = factor.begin[level], factor.first[level], factor.rank[level]
    for column in range(first + rank, factor.first[level + 1]):
        own = factor.R[begin + column - first, first : first + rank]
        for j in range(rank):
            total = 0.0
            for k in range(j, rank):
                total += own[k] * factor.R[begin + k, first + j]
            own[j] = total


# --- the final cost ----------------------------------------------------------------------------


@part
def _solve_cost(
    problem: Problem, factor: Factor, cost: FinalCost, target: Vector, chosen: Indices
) -> None:
    """Move the target to the least final cost that leaves all levels as they are."""
    n, taken = len(target), factor.first[len(factor.rank)]
    free = n - taken
    # A basis made at the end has them.
    if factor.whole < len(factor.rank):
        _find_directions(factor, cost, taken)
    _reduce_hessian(problem.H, cost, chosen, free)
    z, rank = cost.z, free
    # A second step removes the error of the first where curvatures lie far apart.
    for step in range(2):
        _find_gradient(problem.H, problem.g, target, cost.gradient)
        for k in range(rank):
            direction = cost.Z[k if step == 0 else cost.pivot[k]]
            z[k] = minus_dot(0.0, direction, cost.gradient)
        if step == 0:
            rank = _factor_hessian(problem.H, cost, free)
        _solve_factored(cost, rank)
        for k in range(rank):
            factor.y[taken + cost.pivot[k]] += z[k]
            add_multiple(target, z[k], cost.Z[cost.pivot[k]])


@part
def _find_gradient(H: Matrix, g: Vector, x: Vector, out: Vector) -> None:
    """Out <- H x + g."""
    multiply(H, x, out)
    add_multiple(out, 1.0, g)


@part
def _find_directions(factor: Factor, cost: FinalCost, taken: int) -> None:
    """Turn the columns of Q in `factor` to those of the free coordinates."""
    Q, n, base = cost.HZ, len(cost.Z), factor.first[factor.whole]
    for j in range(n):
        copy(Q[j, base:], factor.Q[j, base:])
    reflect_rows_by_all(Q, 0, n, factor.V, factor.tau, base, taken, 1)
    for j in range(n):
        for k in range(n - taken):
            cost.Z[k, j] = Q[j, taken + k]


@part
def _reduce_hessian(H: Matrix, cost: FinalCost, chosen: Indices, free: int) -> None:
    """Find the upper triangle of C = Z^T H Z."""
    n = len(H)
    for j in range(n):
        chosen[j] = j
    for k in range(free):
        product = cost.HZ[k]
        product[:] = 0.0
        add_rows(product, H, cost.Z[k], chosen, n, 0)
        for o in range(k + 1):
            cost.C[o, k] = dot(product, cost.Z[o])


@part
def _factor_hessian(H: Matrix, cost: FinalCost, free: int) -> int:
    """Find the Cholesky factor with pivots, in place and transposed; return the rank."""
    C, pivot, z = cost.C, cost.pivot, cost.z
    largest = 0.0
    for i in range(len(pivot)):
        largest = max(largest, abs(H[i, i]))
    for k in range(free):
        pivot[k] = k
    for k in range(free):
        best = k
        for i in range(k + 1, free):
            if C[i, i] > C[best, best]:
                best = i
        if not C[best, best] > SLACK_TOLERANCE * largest:
            return k
        if best != k:
            _exchange(C, k, best, free)
            pivot[k], pivot[best] = pivot[best], pivot[k]
            _swap(z, k, best)
        root = sqrt(C[k, k])
        C[k, k] = root
        row = C[k]
        for j in range(k + 1, free):
            row[j] /= root
        for i in range(k + 1, free):
            add_multiple(C[i, i:free], -row[i], row[i:free])
    return free


@part
def _exchange(C: Matrix, a: int, b: int, free: int) -> None:
    """Exchange two rows and columns, a < b, of an upper triangle."""
    for i in range(a):
        C[i, a], C[i, b] = C[i, b], C[i, a]
    for i in range(a + 1, b):
        C[a, i], C[i, b] = C[i, b], C[a, i]
    for i in range(b + 1, free):
        C[a, i], C[b, i] = C[b, i], C[a, i]
    C[a, a], C[b, b] = C[b, b], C[a, a]


@part
def _solve_factored(cost: FinalCost, rank: int) -> None:
    """Solve U^T U z = slopes for the curved directions; the flat ones stay as they are."""
    C, z = cost.C, cost.z
    for k in range(rank):
        z[k] /= C[k, k]
        add_multiple(z[k + 1 : rank], -z[k], C[k, k + 1 : rank])
    for k in range(rank - 1, -1, -1):
        total, row = z[k], C[k]
        for i in range(k + 1, rank):
            total -= row[i] * z[i]
        z[k] = total / row[k]


# --- damping near singularities -----------------------------------------------------------------


@part
def damp_equalities(problem: Problem, work: SearchWork) -> None:
    """Move the bounds of equalities whose level is nearer to a singularity than its damping.

    It regards equalities alone, before the search: an active set must not change the problem.
    """
    if not norm_of(problem.damping) > 0.0:
        return
    rows, factor, sides = work.rows, work.factor, work.rows.factored
    for i in range(len(rows.side)):
        sides[i], rows.shift[i] = rows.side[i], 0.0
        if rows.side[i] != EQUALITY:
            rows.side[i] = 0
    factor.begin[0] = factor.first[0] = 0
    for level in range(len(factor.rank)):
        _factor_level(problem, work, level)
        damping, eased = problem.damping[level], 0.0
        if damping > 0.0 and factor.rank[level] > 0:
            least = _least_singular_value(factor, work.squares.v, level)
            # The difference of equal squares may be rounding above zero.
            eased = damping * damping - least * least if least < damping else 0.0
        work.answer.eased[level] = eased
        if eased == 0.0:
            _solve_level(problem, factor, work.squares, level)
            continue
        _solve_damped_level(problem, factor, work.squares, level, sqrt(eased))
        for place in range(factor.begin[level], factor.begin[level + 1]):
            index = factor.order[place]
            rows.shift[index] = factor.slack[place] / problem.weights[index]
    for i in range(len(rows.side)):
        rows.side[i] = sides[i]


@part
def _least_singular_value(factor: Factor, room: Vector, level: int) -> float:
    """Find the least singular value of the pivots' triangle L by inverse iteration with L L^T."""
    # It is some percent too large where several lie close together.
    begin, first, rank = factor.begin[level], factor.first[level], factor.rank[level]
    v, least = room[:rank], 0.0
    for k in range(rank):
        # Hardly orthogonal to the direction of the least singular value.
        v[k] = 1.0 + 0.37 * (k % 3)
    for _ in range(30):
        norm = norm_of(v)
        for k in range(rank):
            own = factor.R[begin + k, first : first + rank]
            v[k] = minus_dot(v[k] / norm, v[:k], own) / own[k]
        for k in range(rank - 1, -1, -1):
            own = factor.R[begin + k, first : first + rank]
            v[k] /= own[k]
            add_multiple(v[:k], -v[k], own)
        before, least = least, 1.0 / sqrt(norm_of(v))
        if abs(least - before) <= COARSE * least:
            break
    return least


@part
def _solve_damped_level(
    problem: Problem, factor: Factor, squares: LeastSquares, level: int, damping: float
) -> None:
    """Find coordinates z and slack of a level with the least |slack|^2 + damping^2 |z|^2."""
    begin, end = factor.begin[level], factor.begin[level + 1]
    first, rank = factor.first[level], factor.rank[level]
    z = factor.y[first : first + rank]
    _find_rhs(problem, factor, level)
    for i in range(end - begin):
        row = factor.R[begin + i]
        squares.rhs[i] = factor.rhs[begin + i]
        for j in range(rank):
            squares.T[j, i] = row[first + j]
    solve_damped(squares, end - begin, damping, z)
    for place in range(begin, end):
        own = factor.R[place, first : first + rank]
        factor.slack[place] = -minus_dot(factor.rhs[place], z, own)
