"""Warm starts: a solver that has seen other problems answers like a fresh one."""

import numpy as np

from poise.hqp import HierarchicalProblem, make_solver

from .random_problems import random_problem


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
