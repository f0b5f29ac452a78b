"""Cholesky factor and triangular solves against NumPy's."""

import numpy as np
import pytest

from poise._compiled import factor, solve_rows, solve_transposed


def positive(rng, n):
    A = rng.normal(size=(n, n))
    return A @ A.T + np.eye(n)


@pytest.mark.parametrize("n", [0, 1, 2, 7, 30])
def test_the_factor_is_the_cholesky_factor(n):
    A = positive(np.random.default_rng(n), n)
    lower = np.full((n, n), 7.0)
    assert factor(np.tril(A), lower)
    assert lower == pytest.approx(np.linalg.cholesky(A) if n else lower, abs=1e-12)


@pytest.mark.parametrize("spoil", [np.nan, -1.0, 0.0])
def test_what_is_not_positive_definite_is_said_to_be_so(spoil):
    A = np.eye(4)
    A[2, 2] = spoil
    assert not factor(A, np.zeros((4, 4)))


@pytest.mark.parametrize("n", [0, 1, 5, 21])
def test_rows_and_vectors_are_solved_for(n):
    rng = np.random.default_rng(n)
    A = positive(rng, n)
    L = np.zeros((n, n))
    factor(A, L)
    rows = rng.normal(size=(4, n))
    solved = rows.copy()
    solve_rows(L, solved)
    assert solved @ L.T == pytest.approx(rows, abs=1e-10)
    x = rng.normal(size=n)
    y = x.copy()
    solve_transposed(L, y)
    assert L.T @ y == pytest.approx(x, abs=1e-10)
