"""Cholesky factor and triangular solves of small matrices, in place.

Matrices are those of trees: between numbers of two branches there are zeros. `reach[i]` says where
the numbers of the tree that hangs on number i end; they stand together behind i. A matrix without
zeros is that of a chain, with its own size as the reach of every number.
"""

from math import sqrt

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled._compiling import compiled


@compiled
def factor(
    A: Float64[np.ndarray, "n n"], reach: Int64[np.ndarray, " n"], U: Float64[np.ndarray, "n n"]
) -> bool:
    """Upper factor A = U U^T of a symmetric positive definite matrix.

    Begun at the leaves it has zeros wherever A has them between branches.
    """
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
    """X <- U^-1 X."""
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
    """X <- U^-T x."""
    for i in range(len(U)):
        x[i] /= U[i, i]
        for k in range(i + 1, reach[i]):
            x[k] -= U[i, k] * x[i]
