"""How far the guess of the active set is from the right one, and that both searches take it."""

import numpy as np
import pytest

from poise.hqp import LexicographicSolver
from poise.hqp._tolerances import COLD_CHANGES

from .conditions import worst_violation
from .families import humanoid
from .test_moving import moving_conflict


def cold_changes(problem):
    solver = LexicographicSolver()
    assert solver.run(problem).ok
    return solver.changes


def test_a_cold_search_in_conflict_mostly_ends_with_the_first_factorisation_after_its_guess():
    found = [cold_changes(moving_conflict(seed, 0.0)) for seed in range(100)]
    assert np.mean(np.array(found) <= COLD_CHANGES + 1) >= 0.9


def test_it_does_so_where_a_hundred_rows_stand_in_the_way():
    found = [cold_changes(humanoid(seed)) for seed in range(60)]
    assert np.mean(np.array(found) <= COLD_CHANGES + 1) >= 0.85


@pytest.mark.parametrize("seed", range(5))
def test_what_the_last_solve_needed_does_not_lead_astray(seed):
    solver = LexicographicSolver()
    for jump in (0.0, 1.5, 0.3, 4.0, 0.0):
        problem = moving_conflict(seed, jump)
        assert solver.run(problem).ok
        assert worst_violation(problem, solver.x, solver.multipliers) <= 1e-8
        x = solver.x.copy()
        # Rows that were equalities, and sides without a bound any more, are no hint.
        problem.lower[::3], problem.upper[1::3] = -np.inf, np.inf
        assert solver.run(problem).ok
        assert worst_violation(problem, solver.x, solver.multipliers) <= 1e-8
        assert not np.allclose(x, solver.x)
