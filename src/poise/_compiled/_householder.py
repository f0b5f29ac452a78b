"""Householder reflections I - tau v v^T, from the left and from the right, in place."""

from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._compiled._compiling import compiled


@compiled
def make_reflection(x: Float64[np.ndarray, " n"], v: Float64[np.ndarray, " n"]) -> float:
    """The reflection that turns x into (|x|, 0, ..., 0), a length that is never negative.

    Args:
        x: overwritten with that.
        v: receives the reflection's vector, which begins with one.

    Returns:
        tau, zero where nothing has to be turned.
    """
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
    """X <- (I - tau v v^T) x.

    Args:
        x: overwritten.
        v: the reflection's vector.
        tau: and its factor.
    """
    share = 0.0
    for i in range(len(v)):
        share += v[i] * x[i]
    share *= tau
    for i in range(len(v)):
        x[i] -= share * v[i]


@compiled
def reflect_rows(X: Float64[np.ndarray, "m n"], v: Float64[np.ndarray, " n"], tau: float) -> None:
    """X <- X (I - tau v v^T): reflects every row.

    Args:
        X: overwritten.
        v: the reflection's vector.
        tau: and its factor.
    """
    # Not by `reflect`: making a view of a row takes as long as reflecting a short one.
    for row in range(len(X)):
        share = 0.0
        for i in range(len(v)):
            share += v[i] * X[row, i]
        share *= tau
        for i in range(len(v)):
            X[row, i] -= share * v[i]


@compiled
def reflect_columns(
    X: Float64[np.ndarray, "m n"],
    v: Float64[np.ndarray, " m"],
    tau: float,
    shares: Float64[np.ndarray, " s"],
) -> None:
    """X <- (I - tau v v^T) X: reflects every column.

    Args:
        X: overwritten.
        v: the reflection's vector.
        tau: and its factor.
        shares: scratch of n numbers or more.
    """
    rows, columns = X.shape
    shares[:columns] = 0.0
    for row in range(rows):
        for column in range(columns):
            shares[column] += v[row] * X[row, column]
    for row in range(rows):
        share = tau * v[row]
        for column in range(columns):
            X[row, column] -= share * shares[column]
