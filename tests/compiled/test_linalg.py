"""Reflections, and the factor of a tree's matrix with its triangular solves, against NumPy's."""

import numpy as np
import pytest

from poise._compiled import (
    factor,
    make_reflection,
    reflect,
    reflect_columns,
    reflect_rows,
    solve_columns,
    solve_transposed,
)

VECTORS = {
    "random": np.array([0.3, -1.2, 0.5, 2.0]),
    "nearly along the first": np.array([1.0, 1e-12, -1e-12, 0.0]),
    "against the first": np.array([-2.0, 0.0, 0.0, 0.0]),
    "across": np.array([0.0, 1.0, 2.0, 0.0]),
    "zero": np.zeros(4),
    "a number": np.array([-1.5]),
}

TREES = {
    "nothing": [],
    "a number": [1],
    "a chain": [7] * 7,
    "two chains": [3, 3, 3, 6, 6, 6],
    "a trunk with branches": [9, 9, 5, 5, 5, 9, 9, 8, 9],
}
"""End of the tree on each number."""


def matrix_of(v, tau):
    return np.eye(len(v)) - tau * np.outer(v, v)


@pytest.mark.parametrize("name", VECTORS)
def test_a_vector_is_turned_into_its_length_by_an_orthogonal_matrix(name):
    x = VECTORS[name].copy()
    v = np.zeros(len(x))
    tau = make_reflection(x, v)
    Q = matrix_of(v, tau)
    expected = np.zeros(len(x))
    expected[0] = np.linalg.norm(VECTORS[name])
    assert pytest.approx(np.eye(len(x)), abs=1e-14) == Q @ Q.T
    assert x == pytest.approx(expected, abs=1e-15)
    assert Q @ VECTORS[name] == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("count", range(7))
def test_chosen_rows_and_later_columns_are_reflected_and_the_others_are_left(count):
    rng = np.random.default_rng(count)
    X, v = rng.normal(size=(6, 6)), np.zeros(6)
    tau = make_reflection(rng.normal(size=3), v[2:5])
    Q, rows, columns, last = matrix_of(v, tau), X.copy(), X.copy(), X.copy()
    chosen = rng.permutation(6)[:count]
    reflect_rows(rows, chosen, 2, v[2:5].copy(), tau)
    reflect_columns(columns, 2, 5, 0, v, tau, np.empty(6))
    reflect_columns(last, 2, 5, 4, v, tau, np.empty(6))
    others = np.setdiff1d(np.arange(6), chosen)
    assert rows[chosen] == pytest.approx(X[chosen] @ Q, abs=1e-14)
    assert np.array_equal(rows[others], X[others])
    assert columns == pytest.approx(Q @ X, abs=1e-14)
    assert np.array_equal(columns[[0, 1, 5]], X[[0, 1, 5]])
    assert np.array_equal(last[:, :4], X[:, :4])
    assert np.array_equal(last[:, 4:], columns[:, 4:])
    one = X[1, 2:5].copy()
    reflect(one, v[2:5], tau)
    assert one == pytest.approx((Q @ X[1])[2:5], abs=1e-14)


@pytest.mark.parametrize("name", TREES)
def test_a_trees_factor_is_upper_with_zeros_between_branches_and_solves(name):
    reach, rng = np.array(TREES[name], dtype=np.int64), np.random.default_rng(0)
    n = len(reach)
    J = rng.normal(size=(3, n, n))
    # Like Jacobians of bodies: each is moved by itself and by those that carry it.
    for i in range(n):
        J[:, i, [not k <= i < reach[k] for k in range(n)]] = 0.0
    A, U = np.einsum("aij,aik->jk", J, J) + np.eye(n), np.zeros((n, n))
    assert factor(np.triu(A), reach, U)
    assert pytest.approx(A, abs=1e-12) == U @ U.T
    assert np.array_equal(U, np.triu(U))
    assert (U[np.triu(A) == 0.0] == 0.0).all()
    assert (np.diag(U) > 0.0).all()
    X, x = rng.normal(size=(n, 4)), rng.normal(size=n)
    solved, y = X.copy(), x.copy()
    solve_columns(U, reach, solved)
    solve_transposed(U, reach, y)
    assert U @ solved == pytest.approx(X, abs=1e-10)
    assert U.T @ y == pytest.approx(x, abs=1e-10)


@pytest.mark.parametrize("spoil", [np.nan, -1.0, 0.0])
def test_a_matrix_that_is_not_positive_definite_has_no_factor(spoil):
    A = np.eye(4)
    A[2, 2] = spoil
    assert not factor(A, np.full(4, 4), np.zeros((4, 4)))
