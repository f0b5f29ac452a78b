"""The system (M M^T + D) lambda = a x_0 - b of a guess: its rows, its factor, its solutions."""

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
from poise.hqp._active_set.workspace import EQUALITY, Indices, Matrix, Penalties, Problem, Vector
from poise.hqp._tolerances import FLOOR, RIDGE


@part
def prepare_rows(problem: Problem, guessed: Penalties, chosen: Indices, shift: Vector) -> None:
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
    ridge = RIDGE * trace / n if trace > 0.0 else 1.0
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
def add_row(guessed: Penalties, place: int) -> None:
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
def solve_rhs(guessed: Penalties, count: int) -> None:
    """Divide the right sides by the factor anew, for moved bounds."""
    for k in range(count):
        row = guessed.G[k]
        guessed.rhs[k] = minus_dot(_right(guessed, k), guessed.rhs[:k], row) / row[k]


@part
def _right(guessed: Penalties, place: int) -> float:
    index = guessed.order[place]
    bound = guessed.upper[index] if guessed.side[index] > 0 else guessed.lower[index]
    return float(guessed.start[index] - bound - guessed.moved[index])


@part
def deactivate(guessed: Penalties, place: int, count: int) -> None:
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
def find_multipliers(guessed: Penalties, count: int, out: Vector) -> None:
    """Find the multipliers of the first rows of `order`."""
    copy(out[:count], guessed.rhs)
    for k in range(count - 1, -1, -1):
        out[k] /= guessed.G[k, k]
        add_multiple(out[:k], -out[k], guessed.G[k])


@part
def find_point(guessed: Penalties, count: int) -> None:
    """Find y = C^T (x_0 - x) and the values of all rows, from the multipliers."""
    guessed.y[:] = 0.0
    for k in range(count):
        add_multiple(guessed.y, guessed.multiplier[k], guessed.M[guessed.order[k]])
    for i in range(len(guessed.M)):
        guessed.values[i] = minus_dot(guessed.start[i], guessed.y, guessed.M[i])
