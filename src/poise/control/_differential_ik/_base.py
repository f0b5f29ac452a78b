"""Elimination of a floating base under a stance contact, compiled."""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled, part

BASE = 6
"""Velocities of a floating base."""


@compiled
def map_base(
    J: Float64[np.ndarray, "b nv"],
    joints: Int64[np.ndarray, " n"],
    X: Float64[np.ndarray, "b n"],
    A: Float64[np.ndarray, "b b"],
) -> None:
    """X = -J_b^-1 J_j by elimination with the largest pivots, see `base_from_joints`."""
    size = len(A)
    for i in range(size):
        for j in range(size):
            A[i, j] = J[i, j]
        for k in range(len(joints)):
            X[i, k] = -J[i, size + joints[k]]
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        _swap_rows(A, k, best)
        _swap_rows(X, k, best)
        pivot = A[k, k]
        _divide_row(A, k, pivot)
        _divide_row(X, k, pivot)
        for i in range(size):
            factor = A[i, k]
            if i != k and factor != 0.0:
                _subtract_row(A, i, k, factor)
                _subtract_row(X, i, k, factor)


@compiled
def constrain(
    J: Float64[np.ndarray, "m nv"],
    joints: Int64[np.ndarray, " n"],
    X: Float64[np.ndarray, "b n"],
    out: Float64[np.ndarray, "m n"],
) -> None:
    """Rows J_j + J_b X, see `constrained`."""
    base = len(X)
    for row in range(len(J)):
        own, found = J[row], out[row]
        for k in range(len(joints)):
            found[k] = own[base + joints[k]]
        for b in range(base):
            factor, moved = own[b], X[b]
            # Rows of single joints do not move with the base.
            if factor != 0.0:
                for k in range(len(joints)):
                    found[k] += factor * moved[k]


@part
def _swap_rows(A: Float64[np.ndarray, "m n"], i: int, k: int) -> None:
    """Exchanges two rows."""
    for j in range(A.shape[1]):
        A[i, j], A[k, j] = A[k, j], A[i, j]


@part
def _divide_row(A: Float64[np.ndarray, "m n"], k: int, pivot: float) -> None:
    """Divides a row by its pivot."""
    for j in range(A.shape[1]):
        A[k, j] /= pivot


@part
def _subtract_row(A: Float64[np.ndarray, "m n"], i: int, k: int, factor: float) -> None:
    """Subtracts so many times one row from another."""
    own, other = A[i], A[k]
    for j in range(A.shape[1]):
        own[j] -= factor * other[j]
