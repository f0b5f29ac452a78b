import math

import numpy as np
import pytest
from paths import adjoint, exponential, gamma, hat
from scipy.linalg import expm

from poise.estimation._group import right_error

ANGLES = (0.0, 1e-9, 1e-4, 0.3, 0.999, 1.001, 2.0, 3.1)


def turned_by(angle, seed=0):
    axis = np.random.default_rng(seed).standard_normal(3)
    return angle * axis / np.linalg.norm(axis)


def tangent(angle, seed=0, vectors=3):
    rho = np.random.default_rng((seed, 1)).standard_normal(3 * vectors)
    return np.concatenate([turned_by(angle, seed), rho])


def matrix(R, x):
    X = np.eye(3 + len(x))
    X[:3, :3], X[:3, 3:] = R, x.T
    return X


def algebra(xi):
    """The element of the Lie algebra as a matrix."""
    rows = xi.reshape(-1, 3)
    A = np.zeros((2 + len(rows), 2 + len(rows)))
    A[:3, :3], A[:3, 3:] = hat(rows[0]), rows[1:].T
    return A


def logarithm(R, vectors):
    """Of an element, as its error against the identity."""
    return right_error((R, vectors), (np.eye(3), np.zeros_like(vectors)))


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("angle", ANGLES)
def test_gamma_is_its_series(order, angle):
    phi = turned_by(angle)
    power, total = np.eye(3), np.zeros((3, 3))
    for n in range(60):
        total += power / math.factorial(n + order)
        power = power @ hat(phi)
    np.testing.assert_allclose(gamma(order, phi), total, atol=1e-14)


@pytest.mark.parametrize("angle", [0.3, 0.9, 2.0])
def test_gammas_are_the_integrals_of_the_rotation(angle):
    """t^k Gamma_k(t w) grows by t^(k-1) Gamma_(k-1)(t w)."""
    w, step = turned_by(angle), 1e-5
    for order in (1, 2):
        after, before = (t**order * gamma(order, t * w) for t in (1.0 + step, 1.0 - step))
        rate = (after - before) / (2.0 * step)
        np.testing.assert_allclose(rate, gamma(order - 1, w), atol=1e-9)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_exponential_is_that_of_matrices(angle):
    xi = tangent(angle)
    np.testing.assert_allclose(matrix(*exponential(xi)), expm(algebra(xi)), atol=1e-13)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_logarithm_takes_the_exponential_back(angle):
    xi = tangent(angle)
    np.testing.assert_allclose(logarithm(*exponential(xi)), xi, atol=1e-12)


def test_the_logarithm_of_half_a_turn_is_half_a_turn():
    phi = turned_by(math.pi)
    R = gamma(0, phi)
    found = logarithm(R, np.zeros((1, 3)))[:3]
    assert np.linalg.norm(found) == pytest.approx(math.pi)
    np.testing.assert_allclose(gamma(0, found), R, atol=1e-14)


@pytest.mark.parametrize("seed", range(10))
def test_the_adjoint_carries_a_tangent_vector_across(seed):
    X, xi = matrix(*exponential(tangent(1.5, seed))), tangent(0.4, seed + 100)
    R, x = exponential(tangent(1.5, seed))
    moved = X @ expm(algebra(xi)) @ np.linalg.inv(X)
    np.testing.assert_allclose(expm(algebra(adjoint(R, x) @ xi)), moved, atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_the_error_does_not_change_when_both_are_moved_from_the_right(seed):
    estimate, truth = (exponential(tangent(a, seed + k)) for k, a in enumerate((1.0, 1.3)))
    S, y = exponential(tangent(2.0, seed + 7))

    def moved(element):
        R, x = element
        return R @ S, x + y @ R.T

    error = right_error(estimate, truth)
    np.testing.assert_allclose(right_error(moved(estimate), moved(truth)), error, atol=1e-12)
    X = matrix(*estimate) @ np.linalg.inv(matrix(*truth))
    np.testing.assert_allclose(matrix(*exponential(error)), X, atol=1e-12)
