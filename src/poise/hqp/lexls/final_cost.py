"""The final cost over the coordinates that no level has taken."""

from math import sqrt

import numpy as np

from poise._compiled import part
from poise.hqp.lexls.combinations import add_rows
from poise.hqp.lexls.reflections import reflect_rows
from poise.hqp.lexls.tolerances import FLAT_TOLERANCE
from poise.hqp.lexls.workspace import Problem, Work


@part
def solve_cost(problem: Problem, work: Work, taken: int) -> None:
    """Moves the target to the least final cost that leaves all levels as they are.

    Args:
        problem: the problem.
        work: whose target meets the levels, and is overwritten.
        taken: how many coordinates the levels take.
    """
    n = len(work.x)
    free = n - taken
    _make_basis(work, taken, free)
    _reduce_hessian(problem, work, free)
    force, target, rank = work.force, work.target, free
    # A second step takes off what the first one loses where curvatures lie far apart.
    for step in range(2):
        find_gradient(problem, target, work.hx)
        for k in range(rank):
            direction, push = work.Z[k if step == 0 else work.pivot[k]], 0.0
            for j in range(n):
                push -= direction[j] * work.hx[j]
            force[k] = push
        if step == 0:
            rank = _factor_hessian(problem, work, free)
        _solve_factored(work, rank)
        for k in range(rank):
            place = work.pivot[k]
            direction, share = work.Z[place], force[k]
            work.y[taken + place] += share
            for j in range(n):
                target[j] += share * direction[j]


@part
def find_gradient(problem: Problem, x: np.ndarray, out: np.ndarray) -> None:
    """H x + g.

    Args:
        problem: whose final cost.
        x: the point.
        out: receives it.
    """
    H = problem.H
    for i in range(len(x)):
        total, row = problem.g[i], H[i]
        for j in range(len(x)):
            total += row[j] * x[j]
        out[i] = total


@part
def _make_basis(work: Work, taken: int, free: int) -> None:
    """What Q makes of the unit vectors of the coordinates that are left."""
    Z, n = work.Z, len(work.x)
    Z[:free] = 0.0
    for k in range(free):
        Z[k, taken + k] = 1.0
    for k in range(taken - 1, -1, -1):
        reflect_rows(Z, 0, free, k, work.V[k, k:], work.tau[k])
    for j in range(n):
        for k in range(free):
            work.ZT[j, k] = Z[k, j]


@part
def _reduce_hessian(problem: Problem, work: Work, free: int) -> None:
    """The upper triangle of C = Z^T H Z; H is mostly zeros where it is a mass matrix."""
    n = len(work.x)
    H, chosen = problem.H, work.chosen
    for i in range(n):
        product, row, count = work.force[:free], H[i], 0
        for j in range(n):
            chosen[count] = j
            # Without a branch that nothing could predict.
            count += 1 if row[j] != 0.0 else 0
        product[:] = 0.0
        add_rows(product, work.ZT, row, chosen, count, 0)
        for k in range(free):
            work.HZ[k, i] = product[k]
    for k in range(free):
        left = work.HZ[k]
        for o in range(k, free):
            right, total = work.Z[o], 0.0
            for j in range(n):
                total += left[j] * right[j]
            work.C[k, o] = total


@part
def _factor_hessian(problem: Problem, work: Work, free: int) -> int:
    """Cholesky factor with pivots, in place and transposed; returns the rank."""
    C, pivot, force = work.C, work.pivot, work.force
    largest = 0.0
    for i in range(len(work.x)):
        largest = max(largest, abs(problem.H[i, i]))
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
            force[k], force[best] = force[best], force[k]
        root = sqrt(C[k, k])
        C[k, k] = root
        row = C[k]
        for j in range(k + 1, free):
            row[j] /= root
        for i in range(k + 1, free):
            share, other = row[i], C[i]
            for j in range(i, free):
                other[j] -= share * row[j]
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
def _solve_factored(work: Work, rank: int) -> None:
    """Solves U^T U z = force for the curved directions; the flat ones stay where they are."""
    C, z = work.C, work.force
    for k in range(rank):
        z[k] /= C[k, k]
        row, share = C[k], z[k]
        for i in range(k + 1, rank):
            z[i] -= share * row[i]
    for k in range(rank - 1, -1, -1):
        total, row = z[k], C[k]
        for i in range(k + 1, rank):
            total -= row[i] * z[i]
        z[k] = total / row[k]
