"""Cholesky factor and triangular solves of small matrices, in place."""

import numpy as np
from jaxtyping import Float64

from poise._compiled._compiling import compiled
from poise._compiled._leading import factor_leading, solve_lower, solve_lower_transposed


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
        for j in range(n):
            L[i, j] = A[i, j] if j <= i else 0.0
    return factor_leading(L, n)


@compiled
def solve_rows(L: Float64[np.ndarray, "n n"], X: Float64[np.ndarray, "m n"]) -> None:
    """X <- X L^-T: every row x becomes the solution y of L y = x.

    Args:
        L: lower triangular.
        X: overwritten.
    """
    for row in range(len(X)):
        solve_lower(L, 0, len(L), X[row])


@compiled
def solve_transposed(L: Float64[np.ndarray, "n n"], x: Float64[np.ndarray, " n"]) -> None:
    """X <- L^-T x.

    Args:
        L: lower triangular.
        x: overwritten.
    """
    solve_lower_transposed(L, len(L), x)
