"""Levels of equality rows in conflict, as a robot's tasks are: solved fast, and still exactly."""

import numpy as np
import pytest

from poise.hqp import CascadeSolver, DirectSolver, HierarchicalProblem, certify_point
from poise.hqp.lexicographic import resolve

SIZES = (8, 10, 6, 5, 12)
"""Rows a level: dynamics, limits, then three levels of tasks that want more than there is."""


def moving_conflict(seed: int, time: float) -> HierarchicalProblem:
    """16 variables; hard levels that can be met, tasks that cannot, all moving smoothly."""
    rng = np.random.default_rng(seed)
    problem = HierarchicalProblem.allocate(16, SIZES, bounds_level=1)
    inside = rng.standard_normal(16) + 0.1 * np.sin(time + np.arange(16))
    problem.x_lower[:], problem.x_upper[:] = inside - 2.0, inside + 2.0
    for i, view in enumerate(problem.levels):
        view.A[:] = rng.standard_normal(view.A.shape)
        view.A[:] *= 1.0 + 0.05 * np.sin(time + np.arange(16))
        if i == 1:
            view.lower[:], view.upper[:] = view.A @ inside - 0.5, view.A @ inside + 0.5
            continue
        wanted = view.A @ inside
        if i > 1:
            wanted += rng.standard_normal(len(wanted)) + 0.2 * np.sin(time)
            view.weights[:] = rng.uniform(0.2, 3.0, len(wanted))
        view.lower[:] = view.upper[:] = wanted
    root = rng.standard_normal((16, 16))
    problem.H[:] = 0.1 * np.eye(16) + root @ root.T / 16.0
    problem.g[:] = rng.standard_normal(16)
    return problem


@pytest.mark.parametrize("seed", range(20))
def test_conflicting_task_levels_are_exact_while_they_move(seed: int) -> None:
    solver, reference = DirectSolver(), CascadeSolver("daqp")
    fast = 0
    for tick in range(25):
        problem = moving_conflict(seed, 0.02 * tick)
        solution, other = solver.solve(problem), reference.solve(problem)
        assert solution.ok
        assert solution.relaxed
        assert certify_point(problem, solution.x).worst <= 1e-7
        gap = np.abs(solution.relative_residuals - other.relative_residuals)
        assert gap.max() <= 1e-6
        fast += "soft" in solution.timings
    # The exact resolution is for conflicts among inequalities, of which there are none here.
    assert fast >= 20


def test_a_level_that_can_be_met_again_is_met_at_once() -> None:
    solver = DirectSolver()
    problem = moving_conflict(3, 0.0)
    assert solver.solve(problem).relaxed
    inside = 0.5 * (problem.x_lower + problem.x_upper)
    for view in problem.levels[2:]:
        view.lower[:] = view.upper[:] = view.A @ inside
    solutions = [solver.solve(problem) for _ in range(40)]
    assert all(s.ok and not s.relaxed for s in solutions)
    assert max(s.relative_residuals.max() for s in solutions) <= 1e-9
    assert "hard" in solutions[-1].timings
    np.testing.assert_allclose(solutions[0].x, solutions[-1].x, atol=1e-6)


def last_level_gives(seed: int) -> HierarchicalProblem:
    """10 variables; a last level of low rank in conflict with itself, inequalities near."""
    rng = np.random.default_rng(seed)
    problem = HierarchicalProblem.allocate(10, (4, 6, 4), bounds_level=1)
    inside = rng.standard_normal(10)
    problem.x_lower[:], problem.x_upper[:] = inside - 3.0, inside + 3.0
    first, limits, last = problem.levels
    for view in (first, limits, last):
        view.A[:] = rng.standard_normal(view.A.shape)
    first.lower[:] = first.upper[:] = first.A @ inside
    limits.lower[:], limits.upper[:] = limits.A @ inside - 0.2, limits.A @ inside + 0.2
    last.A[2] *= 0.02
    last.A[3] = last.A[0]
    wanted = last.A @ (inside + 0.1 * rng.standard_normal(10))
    wanted[3] += 1.0
    last.lower[:] = last.upper[:] = wanted
    root = rng.standard_normal((10, 10))
    problem.H[:] = 0.1 * np.eye(10) + root @ root.T / 10.0
    problem.g[:] = 3.0 * rng.standard_normal(10)
    return problem


def test_the_final_cost_chooses_where_inequalities_push_on_the_last_level() -> None:
    fast = 0
    for seed in range(60):
        problem = last_level_gives(seed)
        solution, exact = DirectSolver().solve(problem), resolve(problem, np.inf, ())
        assert solution.ok
        fast += "soft" in solution.timings
        cost, least = (0.5 * x @ problem.H @ x + problem.g @ x for x in (solution.x, exact.x))
        assert cost == pytest.approx(least, abs=1e-5)
    assert fast >= 30
