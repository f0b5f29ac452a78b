"""The one residual measure: weights, simple bounds and scales, by numbers worked out by hand."""

import numpy as np

from poise.hqp import HierarchicalProblem, Level, make_solver
from poise.hqp._measure import measure_point


def weighted_problem():
    """Bounds on x count to the second level; every row has a weight of its own."""
    first = Level(np.eye(2), [3.0, 4.0], [3.0, 4.0], weights=[2.0, 3.0])
    second = Level([[1.0, 1.0]], -np.inf, -1.0, weights=[0.5])
    problem = HierarchicalProblem([first, second], x_lower=[2.0, -np.inf], bounds_level=1)
    problem.weights[0] = 4.0
    return problem


def test_slacks_are_signed_and_residuals_weighted():
    measure = measure_point(weighted_problem(), np.array([1.0, 5.0]))
    np.testing.assert_allclose(measure.slacks, [-1.0, 0.0, -2.0, 1.0, 7.0])
    np.testing.assert_allclose(measure.residuals, [5.0, np.hypot(4.0 * 1.0, 0.5 * 7.0)])


def test_scales_are_weighted_residuals_at_zero_and_at_least_one():
    measure = measure_point(weighted_problem(), np.array([1.0, 5.0]))
    np.testing.assert_allclose(measure.scales, [np.hypot(6.0, 12.0), np.hypot(8.0, 0.5)])
    np.testing.assert_allclose(measure.relative, measure.residuals / measure.scales)
    easy = HierarchicalProblem([Level([[1.0]], 0.25, 0.25)])
    np.testing.assert_allclose(measure_point(easy, np.array([1.0])).scales, [1.0])


def test_every_strategy_reports_this_measure():
    problem = weighted_problem()
    for strategy in ("direct", "cascade", "weighted"):
        solution = make_solver(strategy).solve(problem)
        measure = measure_point(problem, solution.x)
        np.testing.assert_allclose(solution.slacks, measure.slacks, atol=1e-12)
        np.testing.assert_allclose(solution.residuals, measure.residuals, atol=1e-12)
        np.testing.assert_allclose(solution.relative_residuals, measure.relative, atol=1e-12)
        assert solution.residuals[1] > 1.0
