"""Reflections: what they do to their own vector, to others, and that they are orthogonal."""

import numpy as np
import pytest

from poise._compiled import make_reflection, reflect, reflect_columns, reflect_rows

VECTORS = {
    "random": np.array([0.3, -1.2, 0.5, 2.0]),
    "negative first": np.array([-3.0, 1e-3, 0.0, 0.0]),
    "nearly along the first": np.array([1.0, 1e-12, -1e-12, 0.0]),
    "along the first": np.array([2.0, 0.0, 0.0, 0.0]),
    "against the first": np.array([-2.0, 0.0, 0.0, 0.0]),
    "across": np.array([0.0, 1.0, 2.0, 0.0]),
    "zero": np.zeros(4),
    "a number": np.array([-1.5]),
}


def matrix_of(v, tau):
    return np.eye(len(v)) - tau * np.outer(v, v)


@pytest.mark.parametrize("name", VECTORS)
def test_a_vector_is_turned_into_its_length(name):
    x = VECTORS[name].copy()
    v = np.zeros(len(x))
    tau = make_reflection(x, v)
    Q = matrix_of(v, tau)
    assert pytest.approx(np.eye(len(x)), abs=1e-14) == Q @ Q.T
    expected = np.zeros(len(x))
    expected[0] = np.linalg.norm(VECTORS[name])
    assert x == pytest.approx(expected, abs=1e-15)
    assert Q @ VECTORS[name] == pytest.approx(expected, abs=1e-14)


def test_vectors_rows_and_columns_are_reflected_alike():
    rng = np.random.default_rng(0)
    v = np.zeros(5)
    tau = make_reflection(rng.normal(size=5), v)
    Q, X = matrix_of(v, tau), rng.normal(size=(9, 5))
    columns, one = X.T.copy(), X[1].copy()
    reflect_columns(columns, 0, 5, 0, v, tau, np.empty(len(X)))
    reflect(one, v, tau)
    assert columns == pytest.approx(Q @ X.T, abs=1e-14)
    assert one == pytest.approx(Q @ X[1], abs=1e-14)
    for count in range(len(X) + 1):
        chosen, rows = rng.permutation(len(X))[:count], X.copy()
        reflect_rows(rows, chosen, 0, v, tau)
        assert rows[chosen] == pytest.approx(X[chosen] @ Q, abs=1e-14)
        others = np.setdiff1d(np.arange(len(X)), chosen)
        assert np.array_equal(rows[others], X[others])


def test_a_reflection_of_some_numbers_leaves_the_others():
    rng = np.random.default_rng(1)
    X, v = rng.normal(size=(6, 6)), np.zeros(6)
    tau = make_reflection(rng.normal(size=3), v[2:5])
    Q, rows, columns, last = matrix_of(v, tau), X.copy(), X.copy(), X.copy()
    reflect_rows(rows, np.arange(6), 2, v[2:5].copy(), tau)
    reflect_columns(columns, 2, 5, 0, v, tau, np.empty(6))
    reflect_columns(last, 2, 5, 4, v, tau, np.empty(6))
    assert rows == pytest.approx(X @ Q, abs=1e-14)
    assert columns == pytest.approx(Q @ X, abs=1e-14)
    assert np.array_equal(columns[[0, 1, 5]], X[[0, 1, 5]])
    assert np.array_equal(last[:, :4], X[:, :4])
    assert np.array_equal(last[:, 4:], columns[:, 4:])


def test_compiled_functions_are_plain_functions_underneath():
    assert make_reflection.py_func.__name__ == "make_reflection"
