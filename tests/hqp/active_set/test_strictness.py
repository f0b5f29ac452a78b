"""No level gets worse because a lower level was added, where rows are nearly dependent, too."""

import numpy as np
import pytest

from poise.hqp import HierarchicalProblem, Level, SolveStatus, make_solver
from studies.quiet.strictness_section import exactly_dependent, near_dependent

from .conditions import worst_violation
from .solving import solve


@pytest.mark.parametrize("strategy", ["direct", "cascade"])
def test_a_lower_level_does_not_move_a_row_that_was_left_out_as_dependent(strategy):
    """The last level could be met by x = (0, -5e8), which takes the second from 0.5 to 0.9."""
    levels = [Level([[1.0, 0.0]], 0.0, 0.0), Level([[1.0, 8e-10]], 0.5, 0.5)]
    below = Level([[1.0, -2e-9]], 1.0, 1.0)
    solver = make_solver(strategy)
    for each, expected in ((levels, [0.0, 0.5]), ([*levels, below], [0.0, 0.5, 1.0])):
        solution = solver.solve(HierarchicalProblem(each))
        assert solution.ok
        np.testing.assert_allclose(solution.residuals, expected, atol=1e-8)


def test_a_level_below_keeps_what_does_not_move_the_row():
    levels = [
        Level([[1.0, 0.0, 0.0]], 0.0, 0.0),
        Level([[1.0, 8e-10, 0.0]], 0.5, 0.5),
        Level([[1.0, -2e-9, 0.0], [0.0, 0.0, 1.0]], [1.0, 2.0], [1.0, 2.0]),
    ]
    solution = solve(levels)
    assert solution.ok
    np.testing.assert_allclose(solution.x, [0.0, 0.0, 2.0], atol=1e-8)
    np.testing.assert_allclose(solution.residuals, [0.0, 0.5, 1.0], atol=1e-8)


def test_no_level_rises_silently_and_exact_dependence_raises_no_alarm():
    found = near_dependent(400, 1)
    assert found["silent"] == 0
    assert found["optimal"] > 300
    assert exactly_dependent(200, 1)["optimal"] == 200


def test_answers_with_nearly_dependent_equalities_meet_the_conditions_and_keep_the_order():
    """Levels whose rows contradict each other and depart from each other by less than 1e-9."""
    kept = 0
    for seed in range(100):
        rng = np.random.default_rng([seed, 21])
        n = int(rng.integers(3, 8))
        first = rng.standard_normal((2, n))
        near = rng.standard_normal((3, 2)) @ first
        near += 5e-10 * np.linalg.norm(near, axis=1)[:, None] * _directions(rng, 3, n)
        below = rng.standard_normal((2, 2)) @ first
        below += 5e-8 * np.linalg.norm(below, axis=1)[:, None] * _directions(rng, 2, n)
        levels = [
            Level(A, b, b) for A in (first, near, below) for b in [rng.standard_normal(len(A))]
        ]
        fewer, solution = solve(levels[:2]), solve(levels)
        assert fewer.ok, seed
        if not solution.ok:
            continue
        kept += 1
        np.testing.assert_allclose(solution.residuals[:2], fewer.residuals, atol=1e-6)
        multipliers = np.vstack([solution.level_multipliers, solution.multipliers])
        assert worst_violation(HierarchicalProblem(levels), solution.x, multipliers) <= 1e-8, seed
    assert kept >= 90


def test_a_point_so_far_away_that_rounding_moves_the_first_level_is_not_called_optimal():
    """Each row asks for what the one before it has, and for 2e-9 of a direction of its own."""
    far = 0
    for seed in range(20):
        Q, _ = np.linalg.qr(np.random.default_rng([seed, 22]).standard_normal((4, 4)))
        rows = [Q[0], Q[0] + 2e-9 * Q[1], Q[1] + 2e-9 * Q[2]]
        solution = solve([Level([row], b, b) for row, b in zip(rows, (1.0, 2.0, 3.0), strict=True)])
        if solution.residuals[0] > 1e-7:
            far += 1
            assert solution.status is SolveStatus.INACCURATE
    assert far > 0


def _directions(rng, count, n):
    found = rng.standard_normal((count, n))
    return found / np.linalg.norm(found, axis=1)[:, None]
