"""Warm starts: a solver that has seen other problems answers like a fresh one."""

import numpy as np

from poise.hqp import HierarchicalProblem, make_solver
from poise.hqp._cascade import CascadeSolver

from .random_problems import random_problem


def moving_problem(problem, coefficients, time):
    """Smoothly moving rows; the third level collides with the second half of the time."""
    n = problem.n
    inside = np.sin(time + np.arange(n))
    for view, A in zip(problem.levels, coefficients, strict=True):
        view.A[:] = A * (1.0 + 0.1 * np.sin(time + np.arange(n)))
        centre = view.A @ inside
        view.lower[:], view.upper[:] = centre - 0.5, centre + 0.5
        view.lower[:2] = view.upper[:2] = centre[:2]
    if np.sin(3.0 * time) > 0.0:
        last = problem.level(2)
        last.lower[:3] += 2.0
        last.upper[:3] += 2.0
        problem.x_upper[:] = np.abs(inside) + 0.1
    else:
        problem.x_upper[:] = np.inf


def test_a_warm_cascade_equals_fresh_ones():
    rng = np.random.default_rng(0)
    problem = HierarchicalProblem.allocate(8, [4, 5, 6])
    coefficients = [rng.standard_normal(view.A.shape) for view in problem.levels]
    warm, states = CascadeSolver("osqp"), set()
    for tick in range(200):
        moving_problem(problem, coefficients, 0.02 * tick)
        a, b = warm.solve(problem), CascadeSolver("osqp").solve(problem)
        assert a.ok
        np.testing.assert_allclose(a.relative_residuals, b.relative_residuals, atol=1e-3)
        states.add(a.relaxed)
    assert states == {True, False}


def test_one_solver_through_problems_of_many_shapes_equals_fresh_ones():
    warm = make_solver()
    for seed in range(150):
        problem = random_problem(seed, feasible=seed % 3 != 0)
        a, b = warm.solve(problem), make_solver().solve(problem)
        np.testing.assert_allclose(a.x, b.x, atol=1e-7 * (1 + np.abs(b.x).max()))


def test_a_row_may_turn_from_equality_to_inequality_and_back():
    problem = HierarchicalProblem.allocate(2, [1])
    problem.A[0] = [1.0, 1.0]
    solver = make_solver()
    for lower, upper, expected in [(2.0, 2.0, 1.0), (-1.0, 5.0, 0.0), (4.0, 4.0, 2.0)]:
        problem.level(0).lower[0], problem.level(0).upper[0] = lower, upper
        np.testing.assert_allclose(solver.solve(problem).x, [expected, expected], atol=1e-12)
