"""The problem as a workspace: what stands where before anything is filled in."""

import copy
import pickle

import numpy as np
import pytest

from poise.hqp import HierarchicalProblem, Level, LexicographicSolver, solve


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


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda p: pickle.loads(pickle.dumps(p))]
)
def test_a_copy_is_a_problem_of_its_own_that_is_written_through_its_levels(copied):
    labels = [("hand", 1), ("head", 1)]
    levels = [
        Level(np.eye(2), 1.0, 2.0, weights=3.0, labels=labels, name="a"),
        Level([[1, 1]], 0, 0),
    ]
    problem = HierarchicalProblem(levels, H=2 * np.eye(2), g=[0.5, 0.0], x_upper=5.0)
    problem.labels[:1] = [("left bound", 1), ("right bound", 1)]
    other = copied(problem)
    assert [other.label(row) for row in range(5)] == [problem.label(row) for row in range(5)]
    assert [view.name for view in other.levels] == ["a", "level 1"]
    np.testing.assert_array_equal(solve(other).x, solve(problem).x)
    other.levels[0].lower[:] = other.levels[0].upper[:] = 1.5
    np.testing.assert_allclose(solve(other).x, [1.5, 1.5])
    np.testing.assert_array_equal(problem.lower[2:4], 1.0)


def test_arrays_are_filled_and_not_replaced_for_solvers_keep_them():
    problem = HierarchicalProblem([Level([[1.0, 0.0]], -np.inf, 1.0)])
    solver = LexicographicSolver()
    solver.solve(problem)
    with pytest.raises(AttributeError, match=r"problem\.g\[:\] = "):
        problem.g = np.array([1.0, 0.0])
    problem.g += [1.0, 0.0]
    np.testing.assert_allclose(solver.solve(problem).x, [-1.0, 0.0])


def test_a_solver_that_lies_where_compiled_functions_know_it_is_not_copied():
    solver = LexicographicSolver()
    solver.solve(HierarchicalProblem([Level([[1.0, 0.0]], 2.0, 2.0)]))
    for copied in (copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="neither copied nor pickled"):
            copied(solver)


@pytest.mark.parametrize(
    ("H", "g", "x"),
    [
        # Held by the level, by a bound, and with nothing that curves.
        ([[1.0, 0.0], [0.0, 0.0]], [0.0, 1.0], [0.0, 3.0]),
        ([[0.0, 0.0], [0.0, 1.0]], [1.0, 0.0], [-5.0, 3.0]),
        ([[0.0, 0.0], [0.0, 0.0]], [0.0, 1.0], [0.0, 3.0]),
    ],
)
def test_a_cost_that_levels_and_bounds_hold_has_a_minimum(H, g, x):
    problem = HierarchicalProblem([Level([[0.0, 1.0]], 3.0, 3.0)], H=H, g=g, x_lower=-5.0)
    solution = solve(problem)
    assert solution.ok
    np.testing.assert_allclose(solution.x, x, atol=1e-9)
