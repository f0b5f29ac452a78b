"""The problem as a workspace: what stands where before anything is filled in."""

import numpy as np

from poise.hqp import HierarchicalProblem


def test_an_allocated_problem_asks_for_nothing_and_is_written_through_its_levels():
    problem = HierarchicalProblem.allocate(2, [1, 0, 3], names=["a", "b", "c"], bounds_level=1)
    np.testing.assert_array_equal(problem.A, np.zeros((4, 2)))
    np.testing.assert_array_equal(problem.H, np.eye(2))
    np.testing.assert_array_equal(problem.weights, np.ones(6))
    np.testing.assert_array_equal(problem.x_lower, [-np.inf, -np.inf])
    np.testing.assert_array_equal(problem.x_upper, [np.inf, np.inf])
    np.testing.assert_array_equal(problem.level_of, [1, 1, 0, 2, 2, 2])
    assert [view.name for view in problem.levels] == ["a", "b", "c"]
    problem.levels[2].A[:], problem.levels[2].upper[:] = 5.0, [1.0, 2.0, 3.0]
    np.testing.assert_array_equal(problem.A[:, 0], [0.0, 5.0, 5.0, 5.0])
    np.testing.assert_array_equal(problem.upper[2:], [0.0, 1.0, 2.0, 3.0])
