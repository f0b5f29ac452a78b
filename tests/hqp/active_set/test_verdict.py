"""What the solver says of its own answer: signs of multipliers, doubt, and room in its buffers."""

import numpy as np
import pytest

from poise.hqp import HierarchicalProblem, Level, LexicographicSolver

from .conditions import worst_violation
from .families import contradictory
from .solving import solve


@pytest.mark.parametrize(("side", "bounds"), [(1, (-np.inf, 1.0)), (-1, (-1.0, np.inf))])
@pytest.mark.parametrize("beyond", [1.0, 2.0])
def test_multipliers_are_positive_at_upper_bounds_and_negative_at_lower_ones(side, bounds, beyond):
    """min (x -+ 1 -+ beyond)^2 / 2 beside the bound: H x + g + multiplier = 0."""
    limit = Level([[1.0]], *bounds)
    solution = solve([limit], ([[1.0]], -(1.0 + beyond) * side))
    assert solution.ok
    np.testing.assert_allclose(solution.x, [side])
    np.testing.assert_allclose(solution.multipliers, [0.0, beyond * side])
    np.testing.assert_array_equal(solution.sides, [0, side])


@pytest.mark.parametrize(("side", "bounds"), [(1, (-np.inf, 1.0)), (-1, (-1.0, np.inf))])
def test_a_limit_balances_the_weighted_slack_of_the_level_below(side, bounds):
    task = Level([[1.0]], 3.0 * side, 3.0 * side, weights=[2.0])
    solution = solve([Level([[1.0]], *bounds), task])
    # The task is missed by 2, and weighs 2^2.
    np.testing.assert_allclose(solution.level_multipliers[1], [0.0, 8.0 * side, -8.0 * side])


@pytest.mark.parametrize(("side", "bounds"), [(1, (-np.inf, 1.0)), (-1, (-1.0, np.inf))])
def test_a_bound_that_is_left_behind_is_dropped(side, bounds):
    """A warm start from an active limit that the new task turns away from."""
    solver, limit = LexicographicSolver(), Level([[1.0]], *bounds)
    for wanted, expected, active in ((3.0, 1.0, side), (-3.0, -3.0, 0)):
        task = Level([[1.0]], wanted * side, wanted * side)
        solution = solver.solve(HierarchicalProblem([limit, task]))
        assert solution.ok
        np.testing.assert_allclose(solution.x, [expected * side])
        assert solution.sides[1] == active


def test_answers_that_miss_the_conditions_are_not_called_optimal():
    """Units up to 1e16 apart in one level: rounding of the large rows decides about the small."""
    solver, missed = LexicographicSolver(), 0
    for seed in range(60):
        problem = contradictory(seed, 16)
        solver.reset()
        status = solver.run(problem)
        wrong = worst_violation(problem, solver.x, solver.multipliers) > 1e-7
        missed += wrong
        assert not (wrong and status.ok), seed
    assert missed >= 3
