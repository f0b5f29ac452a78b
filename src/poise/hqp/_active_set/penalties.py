"""The system (M M^T + D) lambda = a x_0 - b of a guess: its rows, its factor, its solutions."""

from math import hypot, sqrt

from poise._compiled import part
from poise.hqp._active_set.kernels import choose_nonzero
from poise.hqp._active_set.workspace import EQUALITY, Indices, Matrix, Penalties, Problem, Vector
from poise.hqp._tolerances import FLOOR, RIDGE


@part
def prepare_rows(problem: Problem, guessed: Penalties, chosen: Indices, shift: Vector) -> None:
    """Finds C, all rows M with their norms, and the rows' values at x_0; no row is active."""
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
        row, square, value = M[i], 0.0, 0.0
        for j in range(n):
            square += row[j] * row[j]
            value -= row[j] * z[j]
        guessed.norm[i], guessed.start[i] = sqrt(square), value
        guessed.lower[i], guessed.upper[i] = problem.lower[i], problem.upper[i]
        side = guessed.side[i] if guessed.side[i] != EQUALITY else 0
        needed_by = guessed.needed_by[i]
        guessed.needed_by[i] = side * (needed_by if needed_by > 0 else len(problem.damping))
        guessed.side[i] = guessed.sign_free[i] = 0
        guessed.moved[i] = guessed.held[i] = shift[i]


@part
def _factor_cost(H: Matrix, C: Matrix, begin: Indices) -> None:
    """C of H, a little of whose trace is added to its diagonal, for it may be singular.

    Rows of C begin where those of H do, which `begin` receives: H is often a few blocks.
    """
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
            other, total = C[j], H[i, j]
            if i == j:
                total += ridge
            # Slices count from zero, where a loop's first number may be negative for all it knows.
            start = max(begin[i], begin[j])
            ours, theirs = row[start:j], other[start:j]
            for k in range(j - start):
                total -= ours[k] * theirs[k]
            if i == j:
                row[i] = sqrt(max(total, ridge))
            else:
                row[j] = total / other[j]


@part
def _invert(C: Matrix, begin: Indices, index: int, column: Vector) -> None:
    """A column of C^-1."""
    column[:] = 0.0
    for k in range(index, len(column)):
        row, total = C[k], 1.0 if k == index else 0.0
        start = max(index, begin[k])
        ours, theirs = row[start:k], column[start:k]
        for j in range(k - start):
            total -= ours[j] * theirs[j]
        column[k] = total / row[k]


@part
def _add_combination(total: Vector, M: Matrix, factors: Vector, chosen: Indices) -> None:
    """Adds C^-1 times a vector, of which most is zero; four columns at once, as in `add_rows`."""
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
        row, factor, out = M[a, a:], factors[a], total[a:]
        for j in range(n - a):
            out[j] += factor * row[j]
        i += 1


@part
def refactor(guessed: Penalties, begin: int, count: int) -> None:
    """Factors the system of the first rows of `order` anew."""
    solve_rhs(guessed, begin)
    for k in range(begin, count):
        add_row(guessed, k)


@part
def add_row(guessed: Penalties, place: int) -> None:
    """Factors one more row of the system, the one that stands at a place in `order`."""
    index = guessed.order[place]
    row, M, n = guessed.G[place], guessed.M[index], len(guessed.y)
    right = _right(guessed, place)
    square = guessed.norm[index] * guessed.norm[index]
    left = square + guessed.compliance[index]
    for k in range(place):
        other, N, total = guessed.G[k], guessed.M[guessed.order[k]], 0.0
        for j in range(n):
            total += M[j] * N[j]
        for j in range(k):
            total -= row[j] * other[j]
        row[k] = total / other[k]
        left -= row[k] * row[k]
        right -= row[k] * guessed.rhs[k]
    row[place] = sqrt(max(left, FLOOR * square))
    guessed.rhs[place] = right / row[place]


@part
def solve_rhs(guessed: Penalties, count: int) -> None:
    """Divides the right sides by the factor anew, their slack being another."""
    for k in range(count):
        row = guessed.G[k]
        left = _right(guessed, k)
        for j in range(k):
            left -= row[j] * guessed.rhs[j]
        guessed.rhs[k] = left / row[k]


@part
def _right(guessed: Penalties, place: int) -> float:
    index = guessed.order[place]
    bound = guessed.upper[index] if guessed.side[index] > 0 else guessed.lower[index]
    return float(guessed.start[index] - bound - guessed.moved[index])


@part
def remove_row(guessed: Penalties, place: int, count: int) -> None:
    """Takes a row out of the system, and out of `order`; rotations mend the factor."""
    G, rhs = guessed.G, guessed.rhs
    for k in range(place, count - 1):
        guessed.order[k], guessed.multiplier[k] = guessed.order[k + 1], guessed.multiplier[k + 1]
        to, source = G[k], G[k + 1]
        for j in range(k + 2):
            to[j] = source[j]
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
    """Multipliers of the first rows of `order`."""
    for k in range(count):
        out[k] = guessed.rhs[k]
    for k in range(count - 1, -1, -1):
        row = guessed.G[k]
        out[k] /= row[k]
        for j in range(k):
            out[j] -= row[j] * out[k]


@part
def find_point(guessed: Penalties, count: int) -> None:
    """C^T (x - x_0) and the values of all rows that the multipliers amount to."""
    n, y = len(guessed.y), guessed.y
    y[:] = 0.0
    for k in range(count):
        row, multiplier = guessed.M[guessed.order[k]], guessed.multiplier[k]
        for j in range(n):
            y[j] -= multiplier * row[j]
    for i in range(len(guessed.M)):
        row, value = guessed.M[i], guessed.start[i]
        for j in range(n):
            value += row[j] * y[j]
        guessed.values[i] = value
