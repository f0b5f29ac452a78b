"""Householder reflections I - tau v v^T, from the left and from the right, in place."""

from math import sqrt

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled._compiling import compiled


@compiled
def make_reflection(x: Float64[np.ndarray, " n"], v: Float64[np.ndarray, " n"]) -> float:
    """The reflection that turns x into (|x|, 0, ..., 0), a length that is never negative."""
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
    """X <- (I - tau v v^T) x."""
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
    """X <- X (I - tau v v^T): reflects some rows, four at a time so that no sum is waited for."""
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
    """X <- (I - tau v v^T) X: reflects all columns from one on."""
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
