"""The system (M M^T + D) lambda = a x_0 - b of `guess`: its rows, its factor, its solutions."""

from math import hypot, sqrt

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import part
from poise.hqp.lexls.system import System
from poise.hqp.lexls.tolerances import FLOOR, RIDGE
from poise.hqp.lexls.workspace import EQUALITY, Problem, Work


@part
def get_ready(problem: Problem, work: Work, system: System) -> None:
    """Finds C, all rows M with their sizes, and the rows' values at x_0; no row is active.

    Args:
        problem: the problem.
        work: whose scratch is used, and in which is what was active, and for which level.
        system: what was active becomes what was needed.
    """
    m, n = problem.A.shape
    M, C, begin = system.M, system.C, work.chosen
    _factor_cost(problem.H, C, begin)
    for i in range(n):
        _invert(C, begin, i, M[i])
    for i in range(m):
        row = M[n + i]
        row[:] = 0.0
        _add_combination(row, M, problem.A[i], work.pivot)
    z = system.y
    z[:] = 0.0
    _add_combination(z, M, problem.g, work.pivot)
    for i in range(n + m):
        # a x_0 = -M C^-1 g.
        row, square, value = M[i], 0.0, 0.0
        for j in range(n):
            square += row[j] * row[j]
            value -= row[j] * z[j]
        system.length[i], system.free[i] = sqrt(square), value
        side = system.side[i] if system.side[i] != EQUALITY else 0
        system.needed[i] = side * (system.needed[i] if system.needed[i] > 0 else len(work.rank))
        system.side[i] = system.firm[i] = 0
        system.gap[i] = system.settled[i] = work.shift[i]


@part
def _factor_cost(
    H: Float64[np.ndarray, "n n"], C: Float64[np.ndarray, "n n"], begin: Int64[np.ndarray, " nm"]
) -> None:
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
def _invert(
    C: Float64[np.ndarray, "n n"],
    begin: Int64[np.ndarray, " nm"],
    index: int,
    column: Float64[np.ndarray, " n"],
) -> None:
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
def _add_combination(
    total: Float64[np.ndarray, " n"],
    M: Float64[np.ndarray, "nm n"],
    shares: Float64[np.ndarray, " n"],
    chosen: Int64[np.ndarray, " n"],
) -> None:
    """Adds C^-1 times a vector, of which most is zero; four columns at once, as in `add_rows`."""
    n, count, i = len(shares), 0, 0
    for j in range(n):
        chosen[count] = j
        # Without a branch that nothing could predict.
        count += 1 if shares[j] != 0.0 else 0
    while i + 4 <= count:
        a, b, c, d = chosen[i], chosen[i + 1], chosen[i + 2], chosen[i + 3]
        # Columns of C^-1 begin at the diagonal.
        m_a, m_b, m_c, m_d, out = M[a, a:], M[b, a:], M[c, a:], M[d, a:], total[a:]
        s_a, s_b, s_c, s_d = shares[a], shares[b], shares[c], shares[d]
        for j in range(n - a):
            out[j] += s_a * m_a[j] + s_b * m_b[j] + s_c * m_c[j] + s_d * m_d[j]
        i += 4
    while i < count:
        a = chosen[i]
        row, share, out = M[a, a:], shares[a], total[a:]
        for j in range(n - a):
            out[j] += share * row[j]
        i += 1


@part
def factor_rows(system: System, begin: int, count: int) -> None:
    """Factors the system of the first rows of `order` anew.

    Args:
        system: whose system.
        begin: the first row whose price is another.
        count: how many rows the system has.
    """
    solve_rest(system, begin)
    for k in range(begin, count):
        add_row(system, k)


@part
def add_row(system: System, place: int) -> None:
    """Factors one more row of the system, the one that stands at a place in `order`.

    Args:
        system: whose G holds the factor, and whose rest the right side divided by it.
        place: where; those before it are factored.
    """
    index = system.order[place]
    row, M, n = system.G[place], system.M[index], len(system.y)
    right = _right(system, place)
    square = system.length[index] * system.length[index]
    left = square + system.price[index]
    for k in range(place):
        other, N, total = system.G[k], system.M[system.order[k]], 0.0
        for j in range(n):
            total += M[j] * N[j]
        for j in range(k):
            total -= row[j] * other[j]
        row[k] = total / other[k]
        left -= row[k] * row[k]
        right -= row[k] * system.rest[k]
    row[place] = sqrt(max(left, FLOOR * square))
    system.rest[place] = right / row[place]


@part
def solve_rest(system: System, count: int) -> None:
    """Divides the right sides by the factor anew, their slack being another.

    Args:
        system: whose rest is found.
        count: how many rows the system has.
    """
    for k in range(count):
        row = system.G[k]
        left = _right(system, k)
        for j in range(k):
            left -= row[j] * system.rest[j]
        system.rest[k] = left / row[k]


@part
def _right(system: System, place: int) -> float:
    index = system.order[place]
    bound = system.upper[index] if system.side[index] > 0 else system.lower[index]
    return float(system.free[index] - bound - system.gap[index])


@part
def remove_row(system: System, place: int, count: int) -> None:
    """Takes a row out of the system, and out of `order`; rotations mend the factor.

    Args:
        system: whose system.
        place: where the row stands.
        count: how many there were.
    """
    G, rest = system.G, system.rest
    for k in range(place, count - 1):
        system.order[k], system.push[k] = system.order[k + 1], system.push[k + 1]
        to, source = G[k], G[k + 1]
        for j in range(k + 2):
            to[j] = source[j]
    for k in range(place, count - 1):
        length = hypot(G[k, k], G[k, k + 1])
        c, s = G[k, k] / length, G[k, k + 1] / length
        for i in range(k, count - 1):
            a, b = G[i, k], G[i, k + 1]
            G[i, k], G[i, k + 1] = c * a + s * b, c * b - s * a
        a, b = rest[k], rest[k + 1]
        rest[k], rest[k + 1] = c * a + s * b, c * b - s * a


@part
def find_lambda(system: System, count: int, out: Float64[np.ndarray, " nm"]) -> None:
    """Multipliers of the first rows of `order`.

    Args:
        system: whose system is factored.
        count: how many rows it has.
        out: receives them.
    """
    for k in range(count):
        out[k] = system.rest[k]
    for k in range(count - 1, -1, -1):
        row = system.G[k]
        out[k] /= row[k]
        for j in range(k):
            out[j] -= row[j] * out[k]


@part
def find_point(system: System, count: int) -> None:
    """C^T (x - x_0) and the values of all rows that the multipliers amount to.

    Args:
        system: whose y and goal are found.
        count: how many rows are active.
    """
    n, y = len(system.y), system.y
    y[:] = 0.0
    for k in range(count):
        row, push = system.M[system.order[k]], system.push[k]
        for j in range(n):
            y[j] -= push * row[j]
    for i in range(len(system.M)):
        row, value = system.M[i], system.free[i]
        for j in range(n):
            value += row[j] * y[j]
        system.goal[i] = value
