"""Random hierarchies of all kinds: the conditions, the reference, and the cascades."""

import numpy as np
import pytest

from poise.hqp import HierarchicalProblem, Level, LexicographicSolver, certify_point
from poise.hqp._active_set.workspace import EQUALITY
from poise.hqp._cascade import CascadeSolver
from poise.hqp._measure import measure_point

from .campaign import beaten_by, cascades
from .conditions import worst_violation
from .families import (
    FAMILIES,
    degenerate,
    duplicates,
    feasible,
    humanoid,
    nearly_dependent,
    overdetermined,
)
from .reference import search

SOLVER = LexicographicSolver()


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_every_answer_called_optimal_meets_the_conditions(family):
    exact, count = 0, 15 if family is humanoid else 100
    for seed in range(count):
        problem = family(seed)
        SOLVER.reset()
        if SOLVER.run(problem).ok:
            exact += 1
            assert worst_violation(problem, SOLVER.x, SOLVER.multipliers) <= 1e-8, seed
    assert exact >= 0.99 * count


@pytest.mark.parametrize("family", [feasible, degenerate], ids=lambda family: family.__name__)
def test_points_are_certified_by_multipliers_found_independently(family):
    for seed in range(2000, 2200):
        problem = family(seed)
        solution = SOLVER.solve(problem)
        assert solution.ok
        assert certify_point(problem, solution.x).worst <= 1e-8, seed


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_no_other_method_meets_a_level_better(family):
    others = cascades(["daqp", "quadprog"])
    for seed in range(300, 303 if family is humanoid else 315):
        problem = family(seed)
        SOLVER.reset()
        assert SOLVER.run(problem).ok, seed
        assert not beaten_by(problem, SOLVER.relative_residuals, others), seed


def test_the_compiled_search_takes_the_steps_of_the_reference():
    # Roundings may part their ways where two rows stop a step at once.
    same = 0
    for seed in range(80):
        problem = degenerate(seed)
        SOLVER.reset()
        solution, found = SOLVER.solve(problem), search(problem)
        assert found.converged
        assert worst_violation(problem, found.x, found.multipliers) <= 1e-8
        np.testing.assert_allclose(solution.x, found.x, atol=1e-8 * (1 + np.abs(found.x).max()))
        same += solution.iterations == found.changes
    assert same >= 70


@pytest.mark.parametrize("family", [nearly_dependent, overdetermined, duplicates])
def test_the_compiled_search_goes_from_set_to_set_as_the_reference(family):
    """Here it exchanges and leaps as often as it takes one step."""
    same = 0
    for seed in range(40):
        problem = family(seed)
        SOLVER.reset()
        solution, found = SOLVER.solve(problem), search(problem)
        gap = np.abs(solution.x - found.x).max() / (1 + np.abs(found.x).max())
        same += solution.iterations == found.changes and gap <= 1e-8
    assert same >= 38


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_a_mirrored_problem_is_solved_by_the_mirrored_steps(family):
    for seed in range(5 if family is humanoid else 30):
        problem, mirrored = family(seed), family(seed)
        mirrored.lower[:], mirrored.upper[:] = -problem.upper, -problem.lower
        mirrored.g[:] = -problem.g
        solutions = []
        for each in (problem, mirrored):
            SOLVER.reset()
            solutions.append(SOLVER.solve(each))
        here, there = solutions
        assert here.iterations == there.iterations, seed
        sided = here.sides != EQUALITY
        np.testing.assert_array_equal(here.sides[sided], -there.sides[sided])
        np.testing.assert_allclose(here.x, -there.x, rtol=1e-12, atol=1e-12)


def test_residuals_equal_those_of_the_cascade():
    cascade = CascadeSolver("daqp")
    for seed in range(100):
        problem = degenerate(seed)
        ours, theirs = SOLVER.solve(problem), cascade.solve(problem)
        gap = np.abs(ours.residuals - theirs.residuals) / measure_point(problem, ours.x).scales
        assert gap.max() <= 1e-7, seed


def test_a_final_cost_without_curvature_where_the_answer_lies_is_no_cause_of_doubt():
    for seed in range(100):
        rng = np.random.default_rng([seed, 11])
        n = int(rng.integers(2, 8))
        root = rng.standard_normal((n, min(2, n - 1)))
        lower = 1e3 * rng.standard_normal(n)
        empty = Level(np.zeros((0, n)), 0.0, 0.0)
        problem = HierarchicalProblem([empty], root @ root.T, 0.0, x_lower=lower)
        solution = LexicographicSolver().solve(problem)
        assert solution.ok, seed
        multipliers = np.vstack([solution.level_multipliers, solution.multipliers])
        assert worst_violation(problem, solution.x, multipliers) <= 1e-8
