"""What a caller may rely on, beyond the optimum: statuses, workspace, warm starts, words."""

import doctest
import tracemalloc

import numpy as np
import pytest

from poise.errors import ConfigurationError, ProblemError
from poise.hqp import HierarchicalProblem, Level, LexicographicSolver, Solver, SolveStatus
from poise.hqp._active_set import solver as module

from ..random_problems import random_problem
from .conditions import worst_violation
from .families import humanoid
from .solving import solve


@pytest.fixture(scope="module")
def solver():
    return LexicographicSolver()


def test_the_example_in_the_docstring_runs():
    assert doctest.testmod(module).failed == 0
    assert doctest.testmod(module).attempted >= 5


def test_it_offers_what_every_strategy_offers(solver):
    assert isinstance(solver, Solver)


def test_a_cost_without_curvature_leaves_its_directions_alone():
    solution = solve([Level([[1.0, 0.0, 0.0]], 1.0, 1.0)], (np.diag([0.0, 2.0, 0.0]), [0, -2.0, 0]))
    assert solution.ok
    np.testing.assert_allclose(solution.x, [1.0, 1.0, 0.0], atol=1e-15)


def test_simple_bounds_count_to_their_level():
    levels = [Level([[1.0, 1.0]], 4.0, 4.0), Level(np.zeros((0, 2)), 0.0, 0.0)]
    np.testing.assert_allclose(
        solve(levels, x_upper=1.0, bounds_level=1).residuals, [0, 2**0.5], atol=1e-12
    )
    np.testing.assert_allclose(solve(levels, x_upper=1.0).residuals, [2 / 3**0.5, 0.0], atol=1e-12)


def test_a_thousand_duplicates_that_contradict_each_other_meet_in_the_middle():
    bounds = np.linspace(-1.0, 1.0, 1000)
    solution = solve([Level(np.ones((1000, 2)), bounds, bounds)])
    assert solution.ok
    np.testing.assert_allclose(solution.x, 0.0, atol=1e-12)


def test_nothing_to_decide_and_nothing_asked_for_is_answered_with_zero():
    empty = Level(np.zeros((0, 3)), 0.0, 0.0)
    zeros = Level(np.zeros((2, 3)), [1.0, -1.0], [2.0, 1.0])
    solution = solve([empty, zeros, empty])
    assert solution.ok
    np.testing.assert_array_equal(solution.x, 0.0)
    np.testing.assert_allclose(solution.residuals, [0.0, 1.0, 0.0])


def test_rows_at_infinity_ask_for_nothing():
    solution = solve([Level(np.eye(2), -np.inf, np.inf), Level([[1.0, 0.0]], 3.0, np.inf)])
    np.testing.assert_allclose(solution.x, [3.0, 0.0])


def test_bad_input_is_refused():
    with pytest.raises(ProblemError, match="cross"):
        solve([Level([[1.0]], 0.0, 1.0)], x_lower=1.0, x_upper=0.0)
    with pytest.raises(ProblemError, match="no levels"):
        solve([])
    with pytest.raises(ProblemError, match="not symmetric"):
        solve([Level(np.eye(2), 0.0, 1.0)], ([[1.0, 1.0], [0.0, 1.0]], 0.0))
    with pytest.raises(ProblemError, match="active set"):
        solve([Level([[1.0]], 0.0, 1.0)], warm_start=np.zeros(5, dtype=np.int64))
    with pytest.raises(ConfigurationError, match="max_changes"):
        LexicographicSolver(max_changes=0)


def test_the_active_set_of_a_solution_starts_another_solver_at_the_optimum(solver):
    for seed in range(50):
        problem = random_problem(seed, feasible=False)
        solver.reset()
        first = solver.solve(problem)
        solver.reset()
        solver.begin_with(problem, first.sides)
        again = solver.solve(problem)
        assert again.iterations <= 2
        np.testing.assert_allclose(again.x, first.x, atol=1e-8 * (1 + np.abs(first.x).max()))


def labelled(A, lower, upper, names):
    return HierarchicalProblem([Level(A, lower, upper, labels=[(name, 1) for name in names])])


def test_a_solver_begins_with_what_another_found_for_rows_of_the_same_labels():
    A, ones = np.eye(3), np.ones(3)
    first = labelled(A, ones, np.full(3, 2.0), ["a", "b", "c"])
    # Two of them in another order, one more, and one that is gone.
    second = labelled(A, ones, np.full(3, 2.0), ["c", "new", "a"])
    here, there = second.rows_shared_with(first)
    assert here.tolist() == [0, 1, 2, 3, 5]
    assert there.tolist() == [0, 1, 2, 5, 3]
    last, solver = LexicographicSolver(), LexicographicSolver()
    last.solve(first)
    assert (last.sides[3:] == -1).all()
    solver.prepare(second)
    solver.follow(second, last)
    assert solver.sides.tolist() == [0, 0, 0, -1, 0, -1]
    assert solver.solve(second).x == pytest.approx(ones)


def test_a_solver_that_nothing_was_asked_of_says_nothing_to_others(solver):
    problem = random_problem(3, feasible=False)
    expected = solver.solve(problem)
    solver.follow(problem, object())
    solver.follow(problem, LexicographicSolver())
    assert solver.sides.tolist() == expected.sides.tolist()


def test_an_equality_whose_interval_opens_begins_at_the_bound_that_it_pressed_against(solver):
    def pressed(most):
        rows = Level(np.array([[1.0, 0.0]]), 1.0, most)
        wish = Level(np.eye(2), [9.0, 0.0], [9.0, 0.0])
        return HierarchicalProblem([rows, wish])

    solver.reset()
    assert solver.solve(pressed(1.0)).x == pytest.approx([1.0, 0.0])
    opened = solver.solve(pressed(3.0))
    assert opened.x == pytest.approx([3.0, 0.0])
    assert opened.iterations == 1


def test_any_active_set_is_good_enough_to_start_from(solver):
    rng = np.random.default_rng(0)
    for seed in range(100):
        problem = random_problem(seed, feasible=False)
        solver.reset()
        expected = solver.solve(problem).residuals
        solver.begin_with(problem, rng.integers(-3, 4, len(problem.lower)))
        found = solver.solve(problem)
        assert found.ok
        assert worst_violation(problem, solver.x, solver.multipliers) <= 1e-8
        np.testing.assert_allclose(found.residuals, expected, atol=1e-7 * (1 + expected.max()))


def test_nothing_is_allocated_after_set_up(solver):
    problem = random_problem(3, feasible=False)
    solver.run(problem)
    tracemalloc.start()
    try:
        before = tracemalloc.take_snapshot()
        for _ in range(50):
            solver.run(problem)
        after = tracemalloc.take_snapshot()
    finally:
        tracemalloc.stop()
    arrays = [tracemalloc.DomainFilter(True, np.lib.tracemalloc_domain)]
    grown = after.filter_traces(arrays).compare_to(before.filter_traces(arrays), "lineno")
    assert sum(entry.count_diff for entry in grown) == 0


def test_the_answer_of_solve_owns_its_arrays(solver):
    problem = random_problem(1, feasible=False)
    first = solver.solve(problem)
    arrays = [first.x, first.multipliers, first.level_multipliers, first.slacks, first.sides]
    kept = [array.copy() for array in arrays]
    problem.g += 1.0
    problem.upper += 0.1
    solver.solve(problem)
    for array, copy in zip(arrays, kept, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_a_cap_on_changes_ends_with_a_finite_point_that_is_not_called_optimal():
    problem = humanoid(222)
    needed = LexicographicSolver().solve(problem).iterations
    assert needed > 5
    solution = LexicographicSolver(max_changes=5).solve(problem)
    assert solution.status is SolveStatus.INACCURATE
    assert solution.iterations == 5
    assert np.isfinite(solution.x).all()
    np.testing.assert_array_equal(solution.level_multipliers, 0.0)


def test_a_cap_on_time_leaves_the_cap_on_changes_as_it_is():
    problem = humanoid(222)
    needed = LexicographicSolver().solve(problem).iterations
    for cap in (1, 2, needed - 1, needed):
        solution = LexicographicSolver(time_limit=60.0, max_changes=cap).solve(problem)
        assert solution.iterations == cap
        assert solution.ok == (cap == needed)


def not_worse(residuals, before):
    """Whether the first level in which they differ by more than rounding is met better."""
    for new, old in zip(residuals, before, strict=True):
        if abs(new - old) > 1e-9 * max(new, old) + 1e-10:
            return new < old
    return True


def test_more_changes_never_make_a_capped_answer_worse():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((200, 60))
    problem = HierarchicalProblem([Level(A, 0.0, np.inf), Level(A, -np.inf, -1.0)])
    before = np.full(2, np.inf)
    # Beyond the hundredth change the search has begun anew.
    for cap in (1, 5, 20, 60, 99, 101, 150, 300):
        solver = LexicographicSolver(max_changes=cap)
        solver.run(problem)
        assert not_worse(solver.residuals, before), cap
        before = solver.residuals.copy()


def test_a_time_limit_ends_with_a_finite_point_that_is_not_called_optimal():
    problem = humanoid(222)
    solution = LexicographicSolver(time_limit=1e-6).solve(problem)
    assert solution.status is SolveStatus.TIME_LIMIT
    assert np.isfinite(solution.x).all()
    assert LexicographicSolver(time_limit=60.0).solve(problem).ok


def test_a_row_much_longer_than_the_equalities_it_depends_on_is_not_given_up():
    """What rounding leaves of the slack of 0.2 x = 0.2, a million times over, was 10 for -2e5 x."""
    rows, bounds = [[0.2], [0.001], [-2e5]], np.array([0.2, -0.001, -2e5])
    level = Level(rows, [*bounds[:2], -np.inf], bounds)
    solution = LexicographicSolver().solve(HierarchicalProblem([level]))
    np.testing.assert_allclose(solution.x, 1.0, rtol=1e-12)
    np.testing.assert_allclose(solution.residuals, 0.002, rtol=1e-9)
