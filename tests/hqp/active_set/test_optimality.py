"""Random hierarchies of all kinds: the conditions, the reference, and the cascades."""

import numpy as np
import pytest

from poise.hqp import HierarchicalProblem, Level, LexicographicSolver
from poise.hqp._active_set.workspace import EQUALITY
from poise.hqp._cascade import CascadeSolver

from .conditions import beaten_by, worst_violation
from .families import (
    FAMILIES,
    humanoid,
)

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


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_no_other_method_meets_a_level_better(family):
    others = [CascadeSolver(backend) for backend in ("daqp", "quadprog")]
    for seed in range(300, 303 if family is humanoid else 315):
        problem = family(seed)
        SOLVER.reset()
        assert SOLVER.run(problem).ok, seed
        assert not beaten_by(problem, SOLVER.relative_residuals, others), seed


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
