"""The final cost over the coordinates that no level has taken."""

from math import sqrt

import numpy as np
from jaxtyping import Float64, Int64

from poise.hqp._active_set.kernels import add_rows, choose_nonzero, multiply, reflect_rows
from poise.hqp._active_set.workspace import Factor, FinalCost, Problem
from poise.hqp._tolerances import FLAT_TOLERANCE
from poise.linalg import part


@part
def solve_cost(
    problem: Problem,
    factor: Factor,
    cost: FinalCost,
    target: Float64[np.ndarray, " n"],
    chosen: Int64[np.ndarray, " nm"],
) -> None:
    """Moves the target to the least final cost that leaves all levels as they are.

    Args:
        problem: the problem.
        factor: the levels, solved; receives the coordinates that they leave.
        cost: room.
        target: meets the levels, and is overwritten.
        chosen: scratch.
    """
    n, taken = len(target), factor.first[len(factor.rank)]
    free = n - taken
    _make_basis(factor, cost, taken)
    _reduce_hessian(problem.H, cost, chosen, free)
    z, rank = cost.z, free
    # A second step takes off what the first one loses where curvatures lie far apart.
    for step in range(2):
        find_gradient(problem.H, problem.g, target, cost.gradient)
        for k in range(rank):
            direction, slope = cost.Z[k if step == 0 else cost.pivot[k]], 0.0
            for j in range(n):
                slope -= direction[j] * cost.gradient[j]
            z[k] = slope
        if step == 0:
            rank = _factor_hessian(problem.H, cost, free)
        _solve_factored(cost, rank)
        for k in range(rank):
            place = cost.pivot[k]
            direction, length = cost.Z[place], z[k]
            factor.y[taken + place] += length
            for j in range(n):
                target[j] += length * direction[j]


@part
def find_gradient(
    H: Float64[np.ndarray, "n n"],
    g: Float64[np.ndarray, " n"],
    x: Float64[np.ndarray, " n"],
    out: Float64[np.ndarray, " n"],
) -> None:
    """H x + g.

    Args:
        H: of the final cost.
        g: of the final cost.
        x: the point.
        out: receives it.
    """
    multiply(H, x, out)
    for i in range(len(x)):
        out[i] += g[i]


@part
def _make_basis(factor: Factor, cost: FinalCost, taken: int) -> None:
    """What Q makes of the unit vectors of the coordinates that are left."""
    Z, n = cost.Z, len(cost.Z)
    free = n - taken
    Z[:free] = 0.0
    for k in range(free):
        Z[k, taken + k] = 1.0
    for k in range(taken - 1, -1, -1):
        reflect_rows(Z, 0, free, k, factor.V[k, k:], factor.tau[k])
    for j in range(n):
        for k in range(free):
            cost.ZT[j, k] = Z[k, j]


@part
def _reduce_hessian(
    H: Float64[np.ndarray, "n n"], cost: FinalCost, chosen: Int64[np.ndarray, " nm"], free: int
) -> None:
    """The upper triangle of C = Z^T H Z; H is mostly zeros where it is a mass matrix."""
    n = len(H)
    for i in range(n):
        product, row = cost.z[:free], H[i]
        product[:] = 0.0
        add_rows(product, cost.ZT, row, chosen, choose_nonzero(row, chosen), 0)
        for k in range(free):
            cost.HZ[k, i] = product[k]
    for k in range(free):
        left = cost.HZ[k]
        for o in range(k, free):
            right, total = cost.Z[o], 0.0
            for j in range(n):
                total += left[j] * right[j]
            cost.C[k, o] = total


@part
def _factor_hessian(H: Float64[np.ndarray, "n n"], cost: FinalCost, free: int) -> int:
    """Cholesky factor with pivots, in place and transposed; returns the rank."""
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
        if not C[best, best] > FLAT_TOLERANCE * largest:
            return k
        if best != k:
            _exchange(C, k, best, free)
            pivot[k], pivot[best] = pivot[best], pivot[k]
            z[k], z[best] = z[best], z[k]
        root = sqrt(C[k, k])
        C[k, k] = root
        row = C[k]
        for j in range(k + 1, free):
            row[j] /= root
        for i in range(k + 1, free):
            ratio, other = row[i], C[i]
            for j in range(i, free):
                other[j] -= ratio * row[j]
    return free


@part
def _exchange(C: np.ndarray, a: int, b: int, free: int) -> None:
    """Exchanges two rows and columns, a < b, of which the upper triangle is kept."""
    for i in range(a):
        C[i, a], C[i, b] = C[i, b], C[i, a]
    for i in range(a + 1, b):
        C[a, i], C[i, b] = C[i, b], C[a, i]
    for i in range(b + 1, free):
        C[a, i], C[b, i] = C[b, i], C[a, i]
    C[a, a], C[b, b] = C[b, b], C[a, a]


@part
def _solve_factored(cost: FinalCost, rank: int) -> None:
    """Solves U^T U z = slopes for the curved directions; the flat ones stay where they are."""
    C, z = cost.C, cost.z
    for k in range(rank):
        z[k] /= C[k, k]
        row, known = C[k], z[k]
        for i in range(k + 1, rank):
            z[i] -= known * row[i]
    for k in range(rank - 1, -1, -1):
        total, row = z[k], C[k]
        for i in range(k + 1, rank):
            total -= row[i] * z[i]
        z[k] = total / row[k]
