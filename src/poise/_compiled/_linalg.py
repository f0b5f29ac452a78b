"""Householder reflections, Cholesky factors and triangular solves, in place.

In `factor`, `solve_columns` and `solve_transposed` matrices are those of trees: entries between two
branches are zero. `reach[i]` is the end of the numbers of the subtree at number i, which follow i.
A dense matrix is that of a chain, with its own size as every reach. `factor_leading` and the
functions after it work on the leading block of larger arrays.
"""

from math import sqrt

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled._compiling import compiled, part


@compiled
def make_reflection(x: Float64[np.ndarray, " n"], v: Float64[np.ndarray, " n"]) -> float:
    """Fill in v of the reflection I - tau v v^T that turns x into (|x|, 0, ...); return tau."""
    first, rest = x[0], 0.0
    for i in range(1, len(x)):
        rest += x[i] * x[i]
    v[0], v[1:] = 1.0, 0.0
    if rest == 0.0:
        x[0] = abs(first)
        return 0.0 if first >= 0.0 else 2.0
    length = sqrt(first * first + rest)
    # Either way without a difference of two numbers that are nearly equal.
    v_0 = first - length if first <= 0.0 else -rest / (first + length)
    for i in range(1, len(x)):
        v[i] = x[i] / v_0
    x[0], x[1:] = length, 0.0
    return 2.0 * v_0 * v_0 / (rest + v_0 * v_0)


@compiled
def reflect(x: Float64[np.ndarray, " n"], v: Float64[np.ndarray, " n"], tau: float) -> None:
    """Set x <- (I - tau v v^T) x."""
    share = 0.0
    for i in range(len(v)):
        share += v[i] * x[i]
    share *= tau
    for i in range(len(v)):
        x[i] -= share * v[i]


@compiled
def reflect_rows(
    X: Float64[np.ndarray, "m n"],
    chosen: Int64[np.ndarray, " c"],
    column: int,
    v: Float64[np.ndarray, " k"],
    tau: float,
) -> None:
    """Set chosen rows X <- X (I - tau v v^T)."""
    # Four rows in one pass, so that sums do not wait for each other.
    end, i = column + len(v), 0
    while i + 4 <= len(chosen):
        a, b = X[chosen[i], column:end], X[chosen[i + 1], column:end]
        c, d = X[chosen[i + 2], column:end], X[chosen[i + 3], column:end]
        s_a = s_b = s_c = s_d = 0.0
        for k in range(len(v)):
            s_a += v[k] * a[k]
            s_b += v[k] * b[k]
            s_c += v[k] * c[k]
            s_d += v[k] * d[k]
        for k in range(len(v)):
            share = tau * v[k]
            a[k] -= s_a * share
            b[k] -= s_b * share
            c[k] -= s_c * share
            d[k] -= s_d * share
        i += 4
    while i < len(chosen):
        reflect(X[chosen[i], column:end], v, tau)
        i += 1


@compiled
def reflect_columns(
    X: Float64[np.ndarray, "m n"],
    begin: int,
    end: int,
    column: int,
    v: Float64[np.ndarray, " m"],
    tau: float,
    shares: Float64[np.ndarray, " n"],
) -> None:
    """Set columns from `column` on X <- (I - tau v v^T) X."""
    total = shares[column:]
    for i in range(len(total)):
        total[i] = 0.0
    for k in range(begin, end):
        row, factor = X[k, column:], v[k]
        for i in range(len(total)):
            total[i] += factor * row[i]
    for k in range(begin, end):
        row, factor = X[k, column:], tau * v[k]
        for i in range(len(total)):
            row[i] -= factor * total[i]


@compiled
def factor(
    A: Float64[np.ndarray, "n n"], reach: Int64[np.ndarray, " n"], U: Float64[np.ndarray, "n n"]
) -> bool:
    """Fill in the upper factor A = U U^T, as sparse as A; return False if A is not positive."""
    for j in range(len(A) - 1, -1, -1):
        rest = A[j, j]
        for k in range(j + 1, reach[j]):
            rest -= U[j, k] * U[j, k]
        if not rest > 0.0:
            return False
        U[j, j] = sqrt(rest)
        for i in range(j):
            if reach[i] > j:
                rest = A[i, j]
                for k in range(j + 1, reach[j]):
                    rest -= U[i, k] * U[j, k]
                U[i, j] = rest / U[j, j]
    return True


@compiled
def solve_columns(
    U: Float64[np.ndarray, "n n"], reach: Int64[np.ndarray, " n"], X: Float64[np.ndarray, "n m"]
) -> None:
    """Set X <- U^-1 X."""
    for i in range(len(U) - 1, -1, -1):
        row, scale = X[i], 1.0 / U[i, i]
        for k in range(i + 1, reach[i]):
            other, share = X[k], U[i, k]
            for column in range(len(row)):
                row[column] -= share * other[column]
        for column in range(len(row)):
            row[column] *= scale


@compiled
def solve_transposed(
    U: Float64[np.ndarray, "n n"], reach: Int64[np.ndarray, " n"], x: Float64[np.ndarray, " n"]
) -> None:
    """Set x <- U^-T x."""
    for i in range(len(U)):
        x[i] /= U[i, i]
        for k in range(i + 1, reach[i]):
            x[k] -= U[i, k] * x[i]


@part
def factor_leading(G: Float64[np.ndarray, "n n"], m: int) -> bool:
    """Replace the lower triangle of G[:m, :m] by its Cholesky factor; False if not positive."""
    for i in range(m):
        for j in range(i):
            rest = G[i, j]
            for k in range(j):
                rest -= G[i, k] * G[j, k]
            G[i, j] = rest / G[j, j]
        rest = G[i, i]
        for k in range(i):
            rest -= G[i, k] * G[i, k]
        if not rest > 0.0:
            return False
        G[i, i] = sqrt(rest)
    return True


@part
def solve_leading(G: Float64[np.ndarray, "n n"], m: int, x: Float64[np.ndarray, " n"]) -> None:
    """Set x <- G^-1 x by the result of `factor_leading`."""
    solve_lower(G, 0, m, x)
    for i in range(m - 1, -1, -1):
        x[i] /= G[i, i]
        for k in range(i):
            x[k] -= G[i, k] * x[i]


@part
def solve_lower(
    L: Float64[np.ndarray, "n n"], begin: int, end: int, y: Float64[np.ndarray, " n"]
) -> None:
    """Solve rows `begin` to `end` of L y = b in place, given y above them."""
    for i in range(begin, end):
        rest = y[i]
        for j in range(i):
            rest -= L[i, j] * y[j]
        y[i] = rest / L[i, i]
