"""The system (M M^T + D) lambda = r of `guess`: its rows, its Cholesky factor, its solutions."""

from math import hypot, sqrt

import numpy as np
from jaxtyping import Float64

from poise.hqp.lexls.reflections import length_of
from poise.hqp.lexls.tolerances import FLOOR, RIDGE
from poise.hqp.lexls.workspace import Problem, Work
from poise.linalg import part


@part
def get_ready(problem: Problem, work: Work) -> None:
    """Finds C, all rows M with their sizes, x_0 and the rows' values there; no row is active."""
    n = len(work.x)
    _factor_cost(problem, work)
    x = work.target
    for j in range(n):
        x[j] = -problem.g[j]
    _solve_lower(work, x)
    for k in range(n - 1, -1, -1):
        row = work.C[k]
        x[k] /= row[k]
        for j in range(k):
            x[j] -= row[j] * x[k]
    for i in range(n + len(problem.A)):
        row, value = work.R[i], 0.0
        if i < n:
            row[:] = 0.0
            row[i], value = 1.0, x[i]
        else:
            source = problem.A[i - n]
            for j in range(n):
                row[j] = source[j]
                value += source[j] * x[j]
        _solve_lower(work, row)
        work.slacks[i], work.size[i] = value, length_of(row)
        work.side[i] = work.firm[i] = 0
        work.slack[i] = work.shift[i]


@part
def _factor_cost(problem: Problem, work: Work) -> None:
    """C of H, a little of whose trace is added to its diagonal, for it may be singular."""
    n, C, trace = len(work.x), work.C, 0.0
    for i in range(n):
        trace += problem.H[i, i]
    ridge = RIDGE * trace / n if trace > 0.0 else 1.0
    for i in range(n):
        row = C[i]
        for j in range(i + 1):
            other, total = C[j], problem.H[i, j]
            if i == j:
                total += ridge
            for k in range(j):
                total -= row[k] * other[k]
            if i == j:
                row[i] = sqrt(max(total, ridge))
            else:
                row[j] = total / other[j]


@part
def _solve_lower(work: Work, x: Float64[np.ndarray, " n"]) -> None:
    """C^-1 x, in place."""
    for k in range(len(x)):
        row, total = work.C[k], x[k]
        for j in range(k):
            total -= row[j] * x[j]
        x[k] = total / row[k]


@part
def factor_rows(problem: Problem, work: Work, count: int) -> None:
    """Factors the system of the first rows of `order` anew."""
    for k in range(count):
        add_row(problem, work, k)


@part
def add_row(problem: Problem, work: Work, place: int) -> None:
    """Factors one more row of the system, the one that stands at a place in `order`.

    Args:
        problem: the problem.
        work: whose G holds the factor, and whose rest the right side divided by it.
        place: where; those before it are factored.
    """
    index = work.order[place]
    row, M, n = work.G[place], work.R[index], len(work.x)
    bound = problem.upper[index] if work.side[index] > 0 else problem.lower[index]
    right = work.slacks[index] - bound - work.slack[index]
    square = work.size[index] * work.size[index]
    left = square + work.kept[index]
    for k in range(place):
        other, N, total = work.G[k], work.R[work.order[k]], 0.0
        for j in range(n):
            total += M[j] * N[j]
        for j in range(k):
            total -= row[j] * other[j]
        row[k] = total / other[k]
        left -= row[k] * row[k]
        right -= row[k] * work.rest[k]
    row[place] = sqrt(max(left, FLOOR * square))
    work.rest[place] = right / row[place]


@part
def remove_row(work: Work, place: int, count: int) -> None:
    """Takes a row out of the system, and out of `order`; rotations mend the factor.

    Args:
        work: whose system.
        place: where the row stands.
        count: how many there were.
    """
    G, rest = work.G, work.rest
    for k in range(place, count - 1):
        work.order[k], work.left[k] = work.order[k + 1], work.left[k + 1]
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
def find_lambda(work: Work, count: int, out: Float64[np.ndarray, " nm"]) -> None:
    """Multipliers of the first rows of `order`.

    Args:
        work: whose system is factored.
        count: how many rows it has.
        out: receives them.
    """
    for k in range(count):
        out[k] = work.rest[k]
    for k in range(count - 1, -1, -1):
        row = work.G[k]
        out[k] /= row[k]
        for j in range(k):
            out[j] -= row[j] * out[k]


@part
def find_point(problem: Problem, work: Work, count: int) -> None:
    """C^T (x - x_0) and the values of all rows that the multipliers amount to.

    Args:
        problem: the problem.
        work: whose y and goal are found.
        count: how many rows are active.
    """
    n, y = len(work.x), work.y
    y[:] = 0.0
    for k in range(count):
        row, push = work.R[work.order[k]], work.left[k]
        for j in range(n):
            y[j] -= push * row[j]
    for i in range(n + len(problem.A)):
        row, value = work.R[i], work.slacks[i]
        for j in range(n):
            value += row[j] * y[j]
        work.goal[i] = value
