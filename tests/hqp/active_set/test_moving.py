"""Problems whose numbers move from solve to solve: exact at every tick, and mostly at once."""

import numpy as np
import pytest

from poise.hqp import HierarchicalProblem, Level, LexicographicSolver, certify_point
from poise.hqp._cascade import CascadeSolver

from .conditions import worst_violation

SIZES = (8, 10, 6, 5, 12)
"""Rows a level: dynamics, limits, then three levels of tasks that want more than there is."""


def moving_conflict(seed, time):
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


@pytest.mark.fast_cases(7)
@pytest.mark.parametrize("seed", range(20))
def test_conflicting_task_levels_are_exact_while_they_move(seed):
    solver, cascade = LexicographicSolver(), CascadeSolver("daqp")
    at_once = 0
    for tick in range(25):
        problem = moving_conflict(seed, 0.02 * tick)
        solution = solver.solve(problem)
        assert solution.ok
        assert solution.relaxed
        assert worst_violation(problem, solver.x, solver.multipliers) <= 1e-8
        assert certify_point(problem, solution.x).worst <= 1e-8
        gap = np.abs(solution.relative_residuals - cascade.solve(problem).relative_residuals)
        assert gap.max() <= 1e-6
        at_once += solution.iterations == 1
    assert at_once >= 15


def test_a_level_that_can_be_met_again_is_met_at_once():
    solver = LexicographicSolver()
    problem = moving_conflict(3, 0.0)
    assert solver.solve(problem).relaxed
    inside = 0.5 * (problem.x_lower + problem.x_upper)
    for view in problem.levels[2:]:
        view.lower[:] = view.upper[:] = view.A @ inside
    first, second = solver.solve(problem), solver.solve(problem)
    for solution in (first, second):
        assert solution.ok
        assert not solution.relaxed
        assert solution.relative_residuals.max() <= 1e-9
    assert second.iterations == 1
    np.testing.assert_allclose(first.x, second.x, atol=1e-9)


def last_level_gives(seed):
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


def test_the_final_cost_chooses_where_inequalities_push_on_the_last_level():
    solver, cascade = LexicographicSolver(), CascadeSolver("daqp")
    for seed in range(60):
        problem = last_level_gives(seed)
        assert solver.run(problem).ok
        assert worst_violation(problem, solver.x, solver.multipliers) <= 1e-8
        points = solver.x, cascade.solve(problem).x
        cost, least = (0.5 * x @ problem.H @ x + problem.g @ x for x in points)
        assert cost == pytest.approx(least, abs=1e-5)


def moving_qp(seed, time, *, equalities=4, rows=14, n=10):
    """One level that can be met under a strictly convex cost; some inequalities hold x."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((n, n))
    g = 3.0 * rng.standard_normal(n) + np.sin(time + np.arange(n))
    A = rng.standard_normal((rows, n)) * (1.0 + 0.1 * np.sin(time + np.arange(n)))
    inside = 0.2 * np.sin(time + np.arange(n))
    room = rng.uniform(0.05, 0.5, n + rows)
    room[n : n + equalities] = 0.0
    return HierarchicalProblem(
        [Level(A, A @ inside - room[n:], A @ inside + room[n:])],
        root @ root.T + 0.1 * np.eye(n),
        g,
        inside - room[:n],
        inside + room[:n],
    )


@pytest.mark.parametrize("seed", range(10))
def test_rows_that_can_be_met_are_optimal_at_every_tick(seed):
    solver, fresh, at_once = LexicographicSolver(), LexicographicSolver(), 0
    for tick in range(120):
        problem = moving_qp(seed, 0.02 * tick)
        fresh.reset()
        warm, cold = solver.solve(problem), fresh.solve(problem)
        assert warm.ok
        assert not warm.relaxed
        assert worst_violation(problem, solver.x, solver.multipliers) <= 1e-8
        np.testing.assert_allclose(warm.x, cold.x, atol=1e-8)
        np.testing.assert_allclose(warm.multipliers, cold.multipliers, atol=1e-6)
        at_once += warm.iterations == 1
    # Active rows change here now and then, and stay in between.
    assert 80 < at_once < 120


@pytest.mark.parametrize("seed", range(10))
def test_another_gradient_equals_a_fresh_solve(seed):
    problem, rng = moving_qp(seed, 0.3), np.random.default_rng(seed)
    solver, fresh = LexicographicSolver(), LexicographicSolver()
    for scale in (0.0, 1e-3, 1.0, 10.0, 1e-3):
        problem.g[:] = scale * rng.standard_normal(10)
        fresh.reset()
        warm, cold = solver.solve(problem), fresh.solve(problem)
        assert worst_violation(problem, solver.x, solver.multipliers) <= 1e-8
        np.testing.assert_allclose(warm.x, cold.x, atol=1e-8)


def test_far_apart_curvatures_keep_the_small_components():
    """Against the active rows' own equations, in units in which the curvatures are alike."""
    problem = moving_qp(1, 0.0, equalities=6)
    problem.H[:6, :6] *= 1e-9
    problem.H[:6, 6:] = problem.H[6:, :6] = 0.0
    solution = LexicographicSolver().solve(problem)
    assert solution.ok
    unit = np.where(np.arange(10) < 6, 1e-9**-0.5, 1.0)
    active = np.flatnonzero(solution.sides)
    E = (np.vstack([np.eye(10), problem.A]) * unit)[active]
    bound = np.where(solution.sides == -1, problem.lower, problem.upper)[active]
    zero = np.zeros((len(active), len(active)))
    system = np.block([[problem.H * np.outer(unit, unit), E.T], [E, zero]])
    exact = np.linalg.solve(system, np.concatenate([-problem.g * unit, bound]))[:10] * unit
    np.testing.assert_allclose(solution.x, exact, rtol=1e-9, atol=1e-9)


def poisoned(where, poison, active):
    """A problem with numbers that are none, or hardly any, in a row that is active without them."""
    bad = moving_qp(2, 0.0)
    if where == "A":
        bad.A[active - 10] = poison
    elif where in ("H", "g"):
        getattr(bad, where)[...] = poison
    else:
        for name in ("lower", "upper") if where == "both" else (where,):
            getattr(bad, name)[active] = poison
    return bad


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf, 1e308])
@pytest.mark.parametrize("where", ["H", "g", "A", "lower", "upper", "both"])
def test_numbers_that_are_none_give_a_finite_point_and_are_forgotten(where, poison):
    solver, good = LexicographicSolver(), moving_qp(2, 0.0)
    expected = solver.solve(good)
    bad = poisoned(where, poison, int(np.flatnonzero(expected.sides)[-1]))
    assert np.isfinite(solver.solve(bad).x).all()
    np.testing.assert_allclose(solver.solve(good).x, expected.x, atol=1e-9)
