"""Householder reflections I - tau v v^T of rows, four at a time, and of one vector by many."""

from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._compiled import part


@part
def turn_row(x: Float64[np.ndarray, " n"], v: Float64[np.ndarray, " n"], length: float) -> float:
    """The reflection that turns a row into (-+length, 0, ..., 0), away from its first number.

    Args:
        x: overwritten with that.
        v: receives the reflection's vector.
        length: of x, not zero.

    Returns:
        tau.
    """
    first = x[0]
    end = -length if first >= 0.0 else length
    # Scaled so that v begins with one and no square leaves the range of numbers.
    share = 1.0 / (first - end)
    for i in range(len(x)):
        v[i], x[i] = x[i] * share, 0.0
    v[0], x[0] = 1.0, end
    return (end - first) / end


@part
def copy(to: Float64[np.ndarray, " n"], x: Float64[np.ndarray, " n"]) -> None:
    """Copies numbers; NumPy's way would compile the words of an error that cannot happen."""
    for i in range(len(to)):
        to[i] = x[i]


@part
def length_of(x: Float64[np.ndarray, " n"]) -> float:
    """The length of a vector."""
    square = 0.0
    for i in range(len(x)):
        square += x[i] * x[i]
    return sqrt(square)


@part
def reflect(x: Float64[np.ndarray, " n"], v: Float64[np.ndarray, " n"], tau: float) -> None:
    """X <- (I - tau v v^T) x.

    Args:
        x: overwritten.
        v: the reflection's vector.
        tau: its factor.
    """
    share = 0.0
    for i in range(len(v)):
        share += v[i] * x[i]
    share *= tau
    for i in range(len(v)):
        x[i] -= share * v[i]


@part
def reflect_rows(
    X: Float64[np.ndarray, "m n"],
    begin: int,
    end: int,
    column: int,
    v: Float64[np.ndarray, " k"],
    tau: float,
) -> None:
    """Reflects rows from a column on; four at once, so that none waits for its own sum.

    Args:
        X: whose rows are overwritten.
        begin: first of them.
        end: where they end.
        column: where v begins in them.
        v: the reflection's vector.
        tau: its factor.
    """
    n, i = len(v), begin
    while i + 4 <= end:
        # Single rows are known to lie in one piece, unlike a block of X.
        x_0, x_1, x_2, x_3 = X[i, column:], X[i + 1, column:], X[i + 2, column:], X[i + 3, column:]
        s_0 = s_1 = s_2 = s_3 = 0.0
        for j in range(n):
            s_0 += v[j] * x_0[j]
            s_1 += v[j] * x_1[j]
            s_2 += v[j] * x_2[j]
            s_3 += v[j] * x_3[j]
        s_0 *= tau
        s_1 *= tau
        s_2 *= tau
        s_3 *= tau
        for j in range(n):
            x_0[j] -= s_0 * v[j]
            x_1[j] -= s_1 * v[j]
            x_2[j] -= s_2 * v[j]
            x_3[j] -= s_3 * v[j]
        i += 4
    while i < end:
        reflect(X[i, column:], v, tau)
        i += 1
