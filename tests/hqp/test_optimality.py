"""The certificate itself: what it must refuse."""

import numpy as np
import pytest

from poise.hqp import HierarchicalProblem, Level, certify_point, solve

from .random_problems import random_problem


def test_a_row_that_depends_on_others_to_rounding_excuses_nothing():
    """Its share of the last level's direction, times a multiplier of 1e14, would balance it."""
    problem = HierarchicalProblem(
        [
            Level([[1.0, 0.0]], 0.0, 0.0),
            Level([[1.0, 1e-14]], -np.inf, 0.0),
            Level([[0.0, 1.0]], 1.0, 1.0),
        ]
    )
    assert certify_point(problem, np.array([0.0, 1.0])).worst < 1e-12
    assert certify_point(problem, np.array([0.0, 0.0])).worst > 0.1


@pytest.mark.parametrize("feasible", [True, False])
def test_points_beside_the_optimum_are_refused(feasible):
    rng = np.random.default_rng(0)
    for seed in range(100):
        problem = random_problem(seed, feasible=feasible)
        x = solve(problem).x
        assert certify_point(problem, x).worst < 1e-8
        beside = x + 1e-3 * (1.0 + np.abs(x).max()) * rng.standard_normal(len(x))
        assert certify_point(problem, beside).worst > 1e-5


@pytest.mark.parametrize("feasible", [True, False])
def test_the_certificates_multipliers_balance_every_level(feasible):
    """sum_i m_ki a_i = 0, with bounds' own normals first."""
    for seed in range(20):
        problem = random_problem(seed, feasible=feasible)
        rows = np.vstack([np.eye(problem.n), problem.A])
        norms = np.linalg.norm(rows, axis=1)
        for multipliers in certify_point(problem, solve(problem).x).multipliers:
            size = np.abs(multipliers * norms).max(initial=1e-300)
            assert np.abs(rows.T @ multipliers).max() < 1e-7 * size, seed


def test_rows_of_other_units_in_a_level_balance_by_slack_that_is_rounding():
    """What a row in millionths misses, 5e-13 of its size, holds up half of the other's force."""
    level = Level(np.array([[1e6, 0.0], [1.0, 0.0], [0.0, 1.0]]), [0.0, 1.0, 2.0], [0.0, 1.0, 2.0])
    problem = HierarchicalProblem([level], x_lower=[-np.inf, 3.0])
    certificate = solve(problem).certify(problem)
    assert certificate.worst < 1e-8
    rows = np.vstack([np.eye(2), problem.A])
    np.testing.assert_allclose(rows.T @ certificate.multipliers[0], 0.0, atol=1e-8)
    # But only as much as such a slack can be.
    assert certify_point(problem, np.array([0.5, 2.5])).worst > 0.1
    assert certify_point(problem, np.array([0.0, 2.6])).worst > 0.1


def test_a_level_with_rows_of_many_units_is_certified():
    for seed in range(50):
        rng = np.random.default_rng(seed)
        A = rng.integers(-2, 3, (4, 4)) * 10.0 ** rng.integers(-3, 4, (4, 1))
        bounds = rng.integers(-3, 4, 4) * np.abs(A).max(axis=1)
        below, above = np.sort(rng.integers(-3, 2, (2, 4)), axis=0).astype(float)
        problem = HierarchicalProblem([Level(A, bounds, bounds)], x_lower=below, x_upper=above)
        assert certify_point(problem, solve(problem).x).worst < 1e-6, seed
