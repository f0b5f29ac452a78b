"""Cholesky factor and triangular solves of small matrices, in place."""

from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._compiled._compiling import compiled


@compiled
def factor(A: Float64[np.ndarray, "n n"], L: Float64[np.ndarray, "n n"]) -> bool:
    """Cholesky factor A = L L^T of a symmetric positive definite matrix.

    Args:
        A: its lower triangle is read.
        L: receives the factor; what is above its diagonal becomes zero.

    Returns:
        Whether A is positive definite; False for NaN, too. If not, L is of no use.
    """
    n = len(A)
    for i in range(n):
        for j in range(i):
            rest = A[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = rest / L[j, j]
        rest = A[i, i]
        for k in range(i):
            rest -= L[i, k] * L[i, k]
        if not rest > 0.0:
            return False
        L[i, i] = sqrt(rest)
        L[i, i + 1 :] = 0.0
    return True


@compiled
def solve_rows(L: Float64[np.ndarray, "n n"], X: Float64[np.ndarray, "m n"]) -> None:
    """X <- X L^-T: every row x becomes the solution y of L y = x.

    Args:
        L: lower triangular.
        X: overwritten.
    """
    n = len(L)
    for row in range(len(X)):
        for i in range(n):
            rest = X[row, i]
            for k in range(i):
                rest -= L[i, k] * X[row, k]
            X[row, i] = rest / L[i, i]


@compiled
def solve_transposed(L: Float64[np.ndarray, "n n"], x: Float64[np.ndarray, " n"]) -> None:
    """X <- L^-T x.

    Args:
        L: lower triangular.
        x: overwritten.
    """
    for i in range(len(L) - 1, -1, -1):
        x[i] /= L[i, i]
        for k in range(i):
            x[k] -= L[i, k] * x[i]
