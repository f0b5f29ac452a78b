"""Cholesky factor and triangular solves of the first rows and columns of an array, in place.

For compiled code alone, whose arrays have room for more than a tick needs.
"""

from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._compiled._compiling import part


@part
def factor_leading(G: Float64[np.ndarray, "n n"], m: int) -> bool:
    """Cholesky factor of the leading block of a symmetric matrix, in its lower triangle."""
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
    """X <- G^-1 x with the factor that `factor_leading` left."""
    solve_lower(G, 0, m, x)
    solve_lower_transposed(G, m, x)


@part
def solve_lower(
    L: Float64[np.ndarray, "n n"], begin: int, end: int, y: Float64[np.ndarray, " n"]
) -> None:
    """Solves some rows of L y = b, given y above them, in place."""
    for i in range(begin, end):
        rest = y[i]
        for j in range(i):
            rest -= L[i, j] * y[j]
        y[i] = rest / L[i, i]


@part
def solve_lower_transposed(
    L: Float64[np.ndarray, "n n"], m: int, x: Float64[np.ndarray, " n"]
) -> None:
    """X <- L^-T x with the leading block of L."""
    for i in range(m - 1, -1, -1):
        x[i] /= L[i, i]
        for k in range(i):
            x[k] -= L[i, k] * x[i]
