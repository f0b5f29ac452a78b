"""The recursion of `OperationalRecursion` over levels that keep their rank, compiled."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, factor_leading, part, solve_leading, solve_lower
from poise.control._osf._rows import BoundRows, LevelRows
from poise.control._row_factor import (
    add_row,
    factor_rows,
    fill_complement,
    keeps_rank,
    turn,
    turn_back,
)
from poise.control._strategy import UNSOFTENED

SLACK = 1e-6
"""Rounding of an acceleration beyond its bounds [rad/s^2, m/s^2]."""

TINY = 1e-12
"""Keeps directions in which softening has nothing to choose from dividing by zero."""


class Ordinary(NamedTuple):
    """What makes a level an ordinary one.

    Attributes:
        physics: least singular value of the physics' rows.
        tasks: of the tasks' rows.
    """

    physics: float
    tasks: float


class Work(NamedTuple):
    """Memory of the recursion; what it leaves there holds until the next state.

    Attributes:
        L: factor of the mass matrix, M = L^T L.
        X: rows J~ = J L^-1 of the leading levels, as `_row_factor` has them.
        tau: factors of their reflections.
        B: accelerations that leave the leading levels alone, orthonormal in the mass metric.
        y: coordinates of the answer that the levels decide: L_J y = target.
        S: acceleration after the leading levels.
        G: scratch.
        F: scratch.
        z: scratch, two rows.
    """

    L: Float64[np.ndarray, "n n"]
    X: Float64[np.ndarray, "n n"]
    tau: Float64[np.ndarray, " n"]
    B: Float64[np.ndarray, "n n"]
    y: Float64[np.ndarray, " n"]
    S: Float64[np.ndarray, " n"]
    G: Float64[np.ndarray, "n n"]
    F: Float64[np.ndarray, "n n"]
    z: Float64[np.ndarray, "2 n"]


def make_work(n: int) -> Work:
    """Memory for a robot of n generalized coordinates."""
    L, X, B, G, F = np.zeros((5, n, n))
    tau, y, S = np.zeros((3, n))
    return Work(L, X, tau, B, y, S, G, F, np.zeros((2, n)))


@compiled
def resolve(
    M: Float64[np.ndarray, "n n"],
    motion: tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " nj"]],
    levels: LevelRows,
    ordinary: Ordinary,
    work: Work,
    dv: Float64[np.ndarray, " n"],
) -> tuple[int, bool]:
    """The acceleration of one state, as long as levels keep their rank.

    The first level that does not may still take all that is left, with nothing lost on the way; so
    does a posture below tasks that leave it less freedom than it has rows.
    """
    h, reference = motion
    _factor_mass(M, work.L)
    regular = _factor_levels(levels, ordinary, reference, work)
    _add_levels(levels, work, regular)
    for i in range(len(dv)):
        dv[i] = work.S[i]
    taken = int(levels.ends[regular])
    if regular == len(levels.ends) - 1:
        _let_go(h, work, taken, dv)
        return regular, True
    find_rest(work, taken)
    return regular, _take_rest(levels, ordinary, work, regular, dv)


@compiled
def is_inside(dv: Float64[np.ndarray, " n"], bounds: BoundRows) -> bool:
    """Return whether an acceleration keeps its bounds up to `SLACK`; NaN does."""
    base = len(dv) - len(bounds.lower)
    for i in range(len(bounds.lower)):
        value = dv[base + i]
        if value > bounds.upper[i] + SLACK or value < bounds.lower[i] - SLACK:
            return False
    for row in range(len(bounds.least)):
        value = 0.0
        for j in range(len(dv)):
            value += bounds.rows[row, j] * dv[j]
        if value > bounds.most[row] + SLACK or value < bounds.least[row] - SLACK:
            return False
    return True


@compiled
def find_rest(work: Work, taken: int) -> None:
    """Accelerations that leave the leading levels alone, in the rows of `work.B`."""
    fill_complement(work.B, work.X, taken, work.tau)
    for i in range(len(work.B) - taken):
        _to_acceleration(work.L, work.B, i)


@part
def _factor_mass(M: Float64[np.ndarray, "n n"], L: Float64[np.ndarray, "n n"]) -> None:
    """M = L^T L, from the last coordinate on: no limb gets coefficients of another.

    Section 6.5 of Featherstone, "Rigid Body Dynamics Algorithms" (2008). NaN stays NaN.
    """
    n = len(M)
    for i in range(n):
        for j in range(i + 1):
            L[i, j] = M[i, j]
    for k in range(n - 1, -1, -1):
        coupled, pivot = L[k], sqrt(L[k, k])
        for i in range(k + 1):
            coupled[i] /= pivot
        for i in range(k):
            factor, row = coupled[i], L[i]
            if factor != 0.0:
                for j in range(i + 1):
                    row[j] -= factor * coupled[j]


@part
def _divide_row(L: Float64[np.ndarray, "n n"], X: Float64[np.ndarray, "m n"], row: int) -> None:
    """X <- x L^-1 for one row; what a limb does not move stays zero and costs nothing."""
    for k in range(len(L) - 1, -1, -1):
        if X[row, k] != 0.0:
            X[row, k] /= L[k, k]
            factor = X[row, k]
            for j in range(k):
                X[row, j] -= factor * L[k, j]


@part
def _to_acceleration(
    L: Float64[np.ndarray, "n n"], Z: Float64[np.ndarray, "m n"], row: int
) -> None:
    """Z <- L^-1 z for one row: from the mass metric's coordinates to accelerations."""
    z = Z[row]
    for i in range(len(L)):
        coupled, rest = L[i], z[i]
        for j in range(i):
            rest -= coupled[j] * z[j]
        z[i] = rest / coupled[i]


@part
def _factor_levels(
    levels: LevelRows, ordinary: Ordinary, reference: Float64[np.ndarray, " nj"], work: Work
) -> int:
    """Factors the leading levels; returns how many keep their rank."""
    n, ends, X, tau = len(work.L), levels.ends, work.X, work.tau
    for level in range(len(levels.softened)):
        levels.softened[level] = 0.0
    for level in range(len(ends) - 1):
        begin, end = int(ends[level]), int(ends[level + 1])
        if end > n:
            return level
        for row in range(begin, end):
            scale = levels.scale[row]
            work.y[row] = scale * levels.target[row]
            for j in range(n):
                X[row, j] = scale * levels.jacobian[row, j]
            _divide_row(work.L, X, row)
        factor_rows(X, begin, end, tau)
        if not keeps_rank(X, begin, end, _least(ordinary, level), work.G):
            return level
        solve_lower(X, begin, end, work.y)
        if levels.softening[level] > 0.0:
            _soften(levels, reference, work, level)
    return len(ends) - 1


@part
def _soften(
    levels: LevelRows, reference: Float64[np.ndarray, " nj"], work: Work, level: int
) -> None:
    """Softens a level whose block L_k of the staircase is regular, if that can change it.

    With p what the joints accelerate beside the reference in the strict answer and D their
    acceleration for a unit of each coordinate that the levels above leave, the least squares of
    |W L_k x_k|^2 + mu^2 |D x + p|^2, W = `mobility`, is what the level's own coordinates x_k
    change by; those of the levels below are theirs. Its rows change by mu |p| at most.
    """
    begin, end, mu = int(levels.ends[level]), int(levels.ends[level + 1]), levels.softening[level]
    D, G, X, x, S = work.F, work.G, work.X, work.z[1], work.z[0]
    size, base, strain = len(S) - begin, len(S) - len(reference), 0.0
    _turn_part(work, 0, end)
    for j in range(len(reference)):
        S[base + j] -= reference[j]
        strain += S[base + j] * S[base + j]
    if mu * sqrt(strain) <= UNSOFTENED:
        return
    levels.softened[level] = mu
    for i in range(size):
        for j in range(len(S)):
            D[i, j] = 0.0
        D[i, begin + i] = 1.0
    turn_back(D, 0, size, X, end, work.tau)
    for i in range(size):
        _to_acceleration(work.L, D, i)
        own, total = D[i, base:], 0.0
        for k in range(len(own)):
            total += own[k] * S[base + k]
        x[i] = -mu * mu * total
        for j in range(i + 1):
            other, total = D[j, base:], 0.0
            for k in range(len(own)):
                total += own[k] * other[k]
            G[i, j] = mu * mu * total + (TINY if i == j else 0.0)
            for row in range(begin + i, end):
                G[i, j] += levels.mobility[row] ** 2 * X[row, begin + i] * X[row, begin + j]
    factor_leading(G, size)
    solve_leading(G, size, x)
    for row in range(begin, end):
        work.y[row] += x[row - begin]


@part
def _least(ordinary: Ordinary, level: int) -> float:
    """Singular value from which a level's direction is controlled exactly."""
    return ordinary.tasks if level > 0 else ordinary.physics


@part
def _turn_part(work: Work, begin: int, end: int) -> None:
    """The acceleration of some places of y, in the first row of z."""
    z = work.z
    for i in range(z.shape[1]):
        z[0, i] = work.y[i] if begin <= i < end else 0.0
    turn_back(z, 0, 1, work.X, end, work.tau)
    _to_acceleration(work.L, z, 0)


@part
def _add_levels(levels: LevelRows, work: Work, regular: int) -> None:
    """S after the leading levels."""
    S, z = work.S, work.z
    for i in range(len(S)):
        S[i] = 0.0
    for level in range(regular):
        _turn_part(work, int(levels.ends[level]), int(levels.ends[level + 1]))
        for i in range(len(S)):
            S[i] += z[0, i]


@part
def _let_go(
    h: Float64[np.ndarray, " n"], work: Work, taken: int, dv: Float64[np.ndarray, " n"]
) -> None:
    """Dv <- dv - N M^-1 h: what no level decides is left without force."""
    z = work.z
    for i in range(len(h)):
        z[0, i] = h[i]
    _divide_row(work.L, z, 0)
    turn(z, 0, 1, work.X, 0, taken, work.tau)
    for i in range(taken):
        z[0, i] = 0.0
    turn_back(z, 0, 1, work.X, taken, work.tau)
    _to_acceleration(work.L, z, 0)
    for i in range(len(h)):
        dv[i] -= z[0, i]


@part
def _take_rest(
    levels: LevelRows, ordinary: Ordinary, work: Work, level: int, dv: Float64[np.ndarray, " n"]
) -> bool:
    """Gives a level all that is left, by least squares, if it loses no direction of that.

    With A = J B and c = target - J S it adds B (A^T A)^-1 A^T c; later levels find nothing.
    """
    begin, end = int(levels.ends[level]), int(levels.ends[level + 1])
    left, G, F, z = len(dv) - begin, work.G, work.F, work.z
    if end - begin < left or levels.may_soften[level]:
        return False
    _square(levels, work, begin, end, left)
    least = _least(ordinary, level)
    for i in range(left):
        for j in range(i):
            F[i, j] = G[i, j]
        F[i, i] = G[i, i] - least * least
    if not (factor_leading(F, left) and factor_leading(G, left)):
        return False
    x = z[1]
    solve_leading(G, left, x)
    for j in range(len(dv)):
        step = 0.0
        for i in range(left):
            step += x[i] * work.B[i, j]
        dv[j] += step
    return True


@part
def _square(levels: LevelRows, work: Work, begin: int, end: int, left: int) -> None:
    """G = A^T A, in its lower triangle, and z[1] = A^T c, row by row of A."""
    S, G, a, total = work.S, work.G, work.z[0], work.z[1]
    for i in range(left):
        total[i] = 0.0
        for j in range(i + 1):
            G[i, j] = 0.0
    for row in range(begin, end):
        J, scale, c = levels.jacobian[row], levels.scale[row], levels.target[row]
        for k in range(len(S)):
            c -= J[k] * S[k]
        for i in range(left):
            direction, a[i] = work.B[i], 0.0
            for k in range(len(S)):
                a[i] += J[k] * direction[k]
        add_row(G, total, a, left, scale * scale, c)
