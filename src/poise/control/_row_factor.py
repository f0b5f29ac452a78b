"""Rows as [L 0] Q, compiled: L lower triangular, Q orthogonal, by Householder reflections.

Prioritised levels one below the other become a staircase by it: the first columns of Q^T span the
levels, in their order, and the others their null space. A square array X of n columns holds the
rows that were factored so far, in place: L on and below the diagonal and right of it the vectors of
the reflections I - tau v v^T, whose leading ones are not written.
"""

from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._compiled import factor_leading, part

ROUNDING = 1e-12
"""Numbers smaller than this, relative to the largest beside them, are rounding."""

SLOP = 1e-9
"""Excess of a bound that is a solver's rounding [rad/s, rad/s^2]."""


@part
def factor_rows(
    X: Float64[np.ndarray, "n n"], begin: int, end: int, tau: Float64[np.ndarray, " n"]
) -> None:
    """Factor a level's rows below those that are factored already."""
    turn(X, begin, end, X, 0, begin, tau)
    for k in range(begin, end):
        tau[k] = _make_reflection(X, k)
        _reflect(X, k + 1, end, X, k, tau[k])


@part
def turn(
    T: Float64[np.ndarray, "m n"],
    begin: int,
    end: int,
    X: Float64[np.ndarray, "n n"],
    first: int,
    last: int,
    tau: Float64[np.ndarray, " n"],
) -> None:
    """Turn rows into the coordinates of the staircase: T <- T Q^T, by some of the reflections."""
    for k in range(first, last):
        _reflect(T, begin, end, X, k, tau[k])


@part
def turn_back(
    T: Float64[np.ndarray, "m n"],
    begin: int,
    end: int,
    X: Float64[np.ndarray, "n n"],
    last: int,
    tau: Float64[np.ndarray, " n"],
) -> None:
    """Turn rows back from those coordinates: T <- T Q."""
    for k in range(last - 1, -1, -1):
        _reflect(T, begin, end, X, k, tau[k])


@part
def fill_complement(
    B: Float64[np.ndarray, "n n"],
    X: Float64[np.ndarray, "n n"],
    taken: int,
    tau: Float64[np.ndarray, " n"],
) -> None:
    """Find an orthonormal basis of the null space of the first rows, in rows."""
    n = len(B)
    for i in range(n - taken):
        for j in range(n):
            B[i, j] = 0.0
        B[i, taken + i] = 1.0
    turn_back(B, 0, n - taken, X, taken, tau)


@part
def keeps_rank(
    X: Float64[np.ndarray, "n n"],
    begin: int,
    end: int,
    least: float,
    G: Float64[np.ndarray, "n n"],
) -> bool:
    """Check that no singular value of a level's own block of L is too small; False for NaN."""
    square_level(X, begin, end, G)
    for i in range(end - begin):
        G[i, i] -= least * least
    return factor_leading(G, end - begin)


@part
def square_level(
    X: Float64[np.ndarray, "n n"], begin: int, end: int, G: Float64[np.ndarray, "n n"]
) -> None:
    """Find G = L L^T with a level's own block of L, in the lower triangle."""
    for i in range(end - begin):
        row = X[begin + i, begin:]
        for j in range(i + 1):
            other, total = X[begin + j, begin:], 0.0
            for k in range(j + 1):
                total += row[k] * other[k]
            G[i, j] = total


@part
def add_row(
    G: Float64[np.ndarray, "n n"],
    x: Float64[np.ndarray, " n"],
    a: Float64[np.ndarray, " n"],
    size: int,
    weight: float,
    c: float,
) -> None:
    """Add a row a y = c to normal equations: G <- G + w a^T a, x <- x + w a^T c."""
    for i in range(size):
        own, factor = G[i], weight * a[i]
        x[i] += factor * c
        for j in range(i + 1):
            own[j] += factor * a[j]


@part
def _make_reflection(X: Float64[np.ndarray, "n n"], k: int) -> float:
    """Reflect a row, from its diagonal on, to (-+ length, 0, ..., 0), in place."""
    v, rest, first = X[k, k + 1 :], 0.0, X[k, k]
    for j in range(len(v)):
        rest += v[j] * v[j]
    if rest == 0.0:
        return 0.0
    length = sqrt(first * first + rest)
    end = -length if first >= 0.0 else length
    shrink = 1.0 / (first - end)
    for j in range(len(v)):
        v[j] *= shrink
    X[k, k] = end
    return (end - first) / end


@part
def _reflect(
    T: Float64[np.ndarray, "m n"],
    begin: int,
    end: int,
    X: Float64[np.ndarray, "n n"],
    k: int,
    tau: float,
) -> None:
    """Reflect rows, two at a time so that neither waits for its own sum."""
    # Rows by themselves are contiguous.
    v, row = X[k, k + 1 :], begin
    while row + 2 <= end:
        x_0, x_1 = T[row, k + 1 :], T[row + 1, k + 1 :]
        s_0, s_1 = T[row, k], T[row + 1, k]
        for j in range(len(v)):
            s_0 += x_0[j] * v[j]
            s_1 += x_1[j] * v[j]
        s_0 *= tau
        s_1 *= tau
        T[row, k] -= s_0
        T[row + 1, k] -= s_1
        for j in range(len(v)):
            x_0[j] -= s_0 * v[j]
            x_1[j] -= s_1 * v[j]
        row += 2
    while row < end:
        x_0, s_0 = T[row, k + 1 :], T[row, k]
        for j in range(len(v)):
            s_0 += x_0[j] * v[j]
        s_0 *= tau
        T[row, k] -= s_0
        for j in range(len(v)):
            x_0[j] -= s_0 * v[j]
        row += 1
