"""Strategy x problem, with the one tolerance table, and what must hold whatever the strategy."""

import sys

import numpy as np
import pytest

from poise.errors import MissingExtraError
from poise.hqp import (
    HierarchicalProblem,
    Level,
    SolveStatus,
    certify_point,
    make_solver,
    solve,
)
from poise.hqp._cascade import CascadeSolver
from poise.hqp._measure import measure_point
from poise.hqp._weighted import WeightedSolver

from .random_problems import random_problem

TOLERANCE = {  # of relative residuals against direct, by backend
    "daqp": 1e-8,
    "proxqp": 1e-6,
    "quadprog": 1e-6,
    "piqp": 1e-5,
    "clarabel": 1e-5,
    "osqp": 1e-4,
}


def conflict_within_a_level():
    return HierarchicalProblem([Level([[1.0, 0.0], [1.0, 0.0]], [0.0, 2.0], [0.0, 2.0])]), [2**0.5]


def conflict_between_levels():
    top = Level([[1.0, 0.0]], -np.inf, 1.0, name="limit")
    low = Level([[1.0, 0.0], [0.0, 1.0]], [3.0, 4.0], [3.0, 4.0], weights=[2.0, 1.0])
    return HierarchicalProblem([top, low]), [0.0, 4.0]


def weights_decide_inside_a_level():
    level = Level([[1.0], [1.0]], [0.0, 1.0], [0.0, 1.0], weights=[2.0, 1.0])
    return HierarchicalProblem([level]), [np.sqrt(0.8)]  # 2 x = y, x + y = 1: x = 0.2, w = 0.8


def redundant_equalities():
    return HierarchicalProblem([Level(np.ones((4, 2)), 2.0, 2.0), Level(np.eye(2), 1.0, 1.0)]), [
        0.0,
        0.0,
    ]


def more_equalities_than_variables():
    A = np.random.default_rng(3).standard_normal((6, 2))
    return HierarchicalProblem([Level(A, A @ [1.0, 2.0], A @ [1.0, 2.0])]), [0.0]


def zero_rows_and_an_empty_level():
    return HierarchicalProblem(
        [Level(np.zeros((2, 2)), [1.0, -1.0], [3.0, 1.0]), Level(np.zeros((0, 2)), 0, 0)]
    ), [1.0, 0.0]


def simple_bounds_of_a_lower_level():
    top = Level([[1.0, 1.0]], 4.0, 4.0)
    return HierarchicalProblem([top, Level(np.zeros((0, 2)), 0, 0)], x_upper=1.0, bounds_level=1), [
        0.0,
        2**0.5,
    ]


PROBLEMS = [
    conflict_within_a_level,
    conflict_between_levels,
    weights_decide_inside_a_level,
    redundant_equalities,
    more_equalities_than_variables,
    zero_rows_and_an_empty_level,
    simple_bounds_of_a_lower_level,
]


@pytest.mark.parametrize("make", PROBLEMS, ids=lambda make: make.__name__)
def test_direct_reaches_the_residuals_worked_out_by_hand(make):
    problem, residuals = make()
    solution = solve(problem)
    assert solution.ok
    np.testing.assert_allclose(solution.residuals, residuals, atol=1e-9)
    assert certify_point(problem, solution.x).worst < 1e-9


@pytest.mark.parametrize("make", PROBLEMS, ids=lambda make: make.__name__)
def test_cascade_reaches_the_residuals_worked_out_by_hand(make, backend):
    problem, residuals = make()
    solution = solve(problem, "cascade", backend=backend)
    assert solution.ok
    gap = np.abs(solution.residuals - residuals) / measure_point(problem, solution.x).scales
    assert gap.max() <= TOLERANCE[backend]


@pytest.mark.parametrize("make", PROBLEMS, ids=lambda make: make.__name__)
def test_weighted_comes_near_the_residuals_worked_out_by_hand(make):
    problem, residuals = make()
    solution = solve(problem, "weighted")
    assert solution.ok
    np.testing.assert_allclose(solution.residuals, residuals, atol=1e-2)


def test_weights_decide_inside_a_level_that_is_a_term_of_the_cost():
    """min (2 x)^2 + (x - 1)^2 below a limit, which makes it one: x = 1 / 5."""
    limit = Level([[1.0]], -5.0, 5.0)
    task = Level([[1.0], [1.0]], [0.0, 1.0], [0.0, 1.0], weights=[2.0, 1.0])
    solution = WeightedSolver().solve(HierarchicalProblem([limit, task]))
    np.testing.assert_allclose(solution.x, [0.2], atol=1e-3)


@pytest.mark.parametrize("weight", [1.0, 2.0])
def test_slack_of_an_inequality_costs_the_ratio_times_its_weight_squared(weight):
    """min x^2 / 2 + ratio weight^2 (x - 1)^2 where x >= 1 stands below a limit."""
    limit, task = Level([[1.0]], -5.0, 5.0), Level([[1.0]], 1.0, np.inf, weights=weight)
    solution = WeightedSolver(ratio=3.0).solve(HierarchicalProblem([limit, task]))
    cost = 2.0 * 3.0 * weight**2
    np.testing.assert_allclose(solution.x, [cost / (1.0 + cost)], rtol=1e-6)


@pytest.mark.parametrize("strategy", ["direct", "cascade"])
@pytest.mark.parametrize("far", [0.0, 0.02, 20.0])
def test_relaxed_says_whether_something_gave(strategy, far):
    limit, task = Level([[1.0]], -np.inf, 1.0), Level([[1.0]], 1.0 + far, np.inf)
    solution = make_solver(strategy).solve(HierarchicalProblem([limit, task]))
    assert solution.relaxed == (far > 0.0)


def test_a_larger_ratio_brings_weighted_nearer_to_the_hierarchy():
    problem, residuals = conflict_between_levels()
    gaps = [
        np.abs(WeightedSolver(ratio=ratio).solve(problem).residuals - residuals).max()
        for ratio in (1e1, 1e3, 1e5)
    ]
    assert gaps[0] > 10 * gaps[1] > 100 * gaps[2]


@pytest.mark.parametrize(("strategy", "backend"), [("direct", None), ("cascade", "daqp")])
def test_a_lower_level_never_worsens_a_higher_one(strategy, backend):
    solver = make_solver(strategy, backend)
    for seed in range(60):
        full = random_problem(seed, feasible=False)
        if full.bounds_level != 0:
            continue
        kept = [Level(v.A, v.lower, v.upper, v.weights) for v in full.levels]
        whole = solver.solve(full)
        for count in range(1, len(kept)):
            part = HierarchicalProblem(kept[:count], x_lower=full.x_lower, x_upper=full.x_upper)
            alone = solver.solve(part).relative_residuals
            np.testing.assert_allclose(whole.relative_residuals[:count], alone, atol=1e-7)


def test_slacks_are_signed_distances_outside_the_bounds():
    solution = solve(HierarchicalProblem([Level([[1.0], [1.0]], [-np.inf, 2.0], [0.0, np.inf])]))
    np.testing.assert_allclose(solution.slacks, [0.0, 1.0, -1.0])
    assert solution.relaxed
    assert solution.active.tolist() == [False, True, True]


def test_final_cost_decides_what_the_levels_leave_free():
    problem = HierarchicalProblem(
        [Level([[1.0, 1.0]], 2.0, 2.0)], H=np.diag([1.0, 3.0]), g=[0.0, -2.0]
    )
    solution = solve(problem)
    np.testing.assert_allclose(solution.x, [1.0, 1.0])
    np.testing.assert_allclose(solution.multipliers, [0.0, 0.0, -1.0], atol=1e-12)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_unit_of_the_final_cost_does_not_change_the_answer(scale):
    for seed in range(40):
        problem = random_problem(seed, feasible=seed % 2 == 0)
        plain = solve(problem)
        problem.H *= scale
        problem.g *= scale
        scaled = solve(problem)
        assert scaled.ok
        np.testing.assert_allclose(scaled.relative_residuals, plain.relative_residuals, atol=1e-7)


def test_a_missing_backend_names_the_command_that_installs_it(monkeypatch):
    monkeypatch.setattr("poise.hqp._backends.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"poise\[solvers\]"):
        CascadeSolver("osqp")


def test_importing_the_package_loads_no_optional_backend():
    import subprocess

    code = "import poise.hqp, sys; print([m for m in ('osqp', 'qpsolvers') if m in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"


@pytest.mark.parametrize("strategy", ["direct", "cascade", "weighted"])
def test_a_time_limit_of_a_microsecond_answers_at_once_with_a_finite_point(strategy):
    problem = random_problem(7, feasible=False)
    backend = None if strategy == "direct" else "daqp"
    solution = solve(problem, strategy, backend=backend, time_limit=1e-6)
    assert solution.status in (SolveStatus.TIME_LIMIT, SolveStatus.OPTIMAL)
    assert np.isfinite(solution.x).all()
    assert solution.timings["total"] < 0.05
