"""The factor of a tree's matrix and triangular solves against NumPy's."""

import numpy as np
import pytest

from poise._compiled import factor, solve_columns, solve_transposed

TREES = {
    "nothing": [],
    "a number": [1],
    "a chain": [7] * 7,
    "two chains": [3, 3, 3, 6, 6, 6],
    "a trunk with branches": [9, 9, 5, 5, 5, 9, 9, 8, 9],
}
"""Where the tree on each number ends."""


def tree(name, seed=0):
    """A matrix with zeros between branches, and the reach of its numbers."""
    reach = np.array(TREES[name], dtype=np.int64)
    n, rng = len(reach), np.random.default_rng(seed)
    J = rng.normal(size=(3, n, n))
    # Like Jacobians of bodies: each is moved by itself and by those that carry it.
    for i in range(n):
        J[:, i, [not k <= i < reach[k] for k in range(n)]] = 0.0
    return np.einsum("aij,aik->jk", J, J) + np.eye(n), reach


def factored(name):
    A, reach = tree(name)
    U = np.zeros_like(A)
    assert factor(np.triu(A), reach, U)
    return A, reach, U


@pytest.mark.parametrize("name", TREES)
def test_the_factor_is_upper_and_has_zeros_between_branches(name):
    A, _, U = factored(name)
    assert pytest.approx(A, abs=1e-12) == U @ U.T
    assert np.array_equal(U, np.triu(U))
    assert (U[np.triu(A) == 0.0] == 0.0).all()
    assert (np.diag(U) > 0.0).all()


@pytest.mark.parametrize("spoil", [np.nan, -1.0, 0.0])
def test_what_is_not_positive_definite_is_said_to_be_so(spoil):
    A = np.eye(4)
    A[2, 2] = spoil
    assert not factor(A, np.full(4, 4), np.zeros((4, 4)))


@pytest.mark.parametrize("name", TREES)
def test_columns_and_vectors_are_solved_for(name):
    _, reach, U = factored(name)
    rng = np.random.default_rng(0)
    X, x = rng.normal(size=(len(U), 4)), rng.normal(size=len(U))
    solved, y = X.copy(), x.copy()
    solve_columns(U, reach, solved)
    solve_transposed(U, reach, y)
    assert U @ solved == pytest.approx(X, abs=1e-10)
    assert U.T @ y == pytest.approx(x, abs=1e-10)
