"""Damping: bounded near singularities, exact away from them, and nothing lost above."""

import numpy as np
import pytest

from poise.errors import ConfigurationError
from poise.hqp import HierarchicalProblem, Level, LexicographicSolver

from .conditions import worst_violation
from .families import nearly_dependent
from .solving import solve

DAMPING = 1e-2


def arm_jacobian(bend):
    """Of a planar arm with two links of 1 m, stretched along x where `bend` is 0."""
    return np.array([[-np.sin(bend), -np.sin(bend)], [1.0 + np.cos(bend), np.cos(bend)]])


def hand_task(bend, velocity=(0.1, 0.0)):
    return Level(arm_jacobian(bend), velocity, velocity)


def test_a_stretched_arm_asked_outwards_stays_slow():
    bends = np.linspace(-0.05, 0.05, 101)
    exact = [np.abs(solve([hand_task(bend)]).x).max() for bend in bends if bend != 0.0]
    damped = np.array([solve([hand_task(bend)], damping=DAMPING).x for bend in bends])
    assert max(exact) > 100.0
    # The least gain is s / d^2 <= 1 / d.
    assert np.abs(damped).max() <= 0.1 / DAMPING
    assert np.abs(np.diff(damped, axis=0)).max() < 1.0


def test_away_from_singularities_the_answer_is_the_same_to_the_last_bit():
    level = hand_task(1.0)
    exact, damped = solve([level]), solve([level], damping=DAMPING)
    np.testing.assert_array_equal(exact.x, damped.x)
    np.testing.assert_array_equal(damped.eased, 0.0)


def test_levels_above_lose_nothing():
    eased = 0
    for seed in range(60):
        problem = nearly_dependent(seed)
        last = len(problem.levels) - 1
        damping = np.zeros(last + 1)
        damping[last] = 0.1
        exact, damped = LexicographicSolver(), LexicographicSolver(damping=damping)
        assert exact.run(problem).ok
        assert damped.run(problem).ok
        eased += damped.eased[last] > 0.0
        np.testing.assert_allclose(
            exact.residuals[:last], damped.residuals[:last], rtol=1e-9, atol=1e-9
        )
    assert eased >= 20


def test_the_conditions_hold_for_the_bounds_that_damping_moved():
    eased = 0
    for seed in range(100):
        problem = nearly_dependent(seed)
        solution = LexicographicSolver(damping=0.05).solve(problem)
        assert solution.ok
        eased += (solution.eased > 0.0).any()
        problem.lower += solution.shift
        problem.upper += solution.shift
        multipliers = np.vstack([solution.level_multipliers, solution.multipliers])
        assert worst_violation(problem, solution.x, multipliers) <= 1e-8
    assert eased > 30


def test_limits_do_not_keep_a_damped_search_from_its_end():
    # The hand is asked further out than the arm reaches, one joint as fast as it may be.
    solver = LexicographicSolver(damping=[0.0, DAMPING, 0.0])
    for bend in np.linspace(-0.05, 0.05, 101):
        limits, rest = Level(np.zeros((0, 2)), 0.0, 0.0), Level(np.eye(2), 0.1, 0.1)
        problem = HierarchicalProblem([limits, hand_task(bend), rest], x_lower=-2.0, x_upper=2.0)
        assert solver.run(problem).ok
        assert solver.changes < 10


def test_each_level_has_its_own_damping():
    weak = Level([[1e-3, 0.0]], 1.0, 1.0)
    other = Level([[0.0, 1e-3]], 1.0, 1.0)
    x = solve([weak, other], damping=[0.0, 1e-2]).x
    np.testing.assert_allclose(x, [1e3, 1e-3 / 1e-4], rtol=1e-9)


@pytest.mark.parametrize("damping", [-1.0, np.nan, np.inf, [], [[1.0]]])
def test_a_damping_that_cannot_be_is_refused(damping):
    with pytest.raises(ConfigurationError, match="damping"):
        LexicographicSolver(damping=damping)


def test_a_damping_of_other_levels_is_refused():
    with pytest.raises(ConfigurationError, match="one entry a level"):
        LexicographicSolver(damping=[1.0, 1.0]).run(HierarchicalProblem([Level([[1.0]], 1, 1)]))
