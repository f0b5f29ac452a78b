"""Random hierarchies are what their knobs say, by measures that do not know how they are made."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.hqp.random_families import (
    Drift,
    drifting_problems,
    family_knobs,
    random_problems,
    turn_active,
    turn_condition,
    turn_conflict,
    turn_contradiction,
    turn_rank,
)
from benchmarks.hqp.random_problems import Knobs
from poise.errors import ConfigurationError
from poise.hqp import LexicographicSolver

TURNS = (turn_rank, turn_condition, turn_conflict, turn_contradiction, turn_active)
COUNT = 6
SMALL = Knobs(variables=20, limits=12, equalities=(4, 6), inequalities=(3, 5), active=3)


@pytest.mark.parametrize("turn", TURNS, ids=lambda turn: turn.__name__)
def test_a_family_is_what_its_knobs_say(turn):
    """By singular values, and by the solution from a cold start."""
    solver = LexicographicSolver()
    for i, problem in enumerate(random_problems(turn, 7, COUNT)):
        problem.validate()
        knobs = family_knobs(turn, 7, i)
        solver.reset()
        solution = solver.solve(problem)
        assert solution.ok
        levels = list(zip(problem.levels[1:], knobs.equalities, knobs.ranks, strict=True))
        for level, m, rank in (one for one in levels if one[1]):
            E = level.A[:m]
            values = np.linalg.svd(E, compute_uv=False)
            assert np.count_nonzero(values > 1e-10) == rank == max(1, round(knobs.rank * m))
            if rank > 1:
                assert values[0] / values[rank - 1] == pytest.approx(knobs.condition, rel=1e-6)
            if knobs.contradiction:
                rows = slice(problem.n + level.slice.start, problem.n + level.slice.start + m)
                pull = problem.weights[rows] ** 2 * solution.slacks[rows]
                size = knobs.contradiction if m > rank else 0.0
                assert np.linalg.norm(pull) == pytest.approx(size, rel=1e-6, abs=1e-9)
                # It is a contradiction: no motion makes the weighted slack smaller.
                np.testing.assert_allclose(E.T @ pull, 0.0, atol=1e-9)
        active = (solution.sides != 0) & ~problem.equality
        assert np.count_nonzero(active) == knobs.active
        missing = np.abs(solution.slacks) > 1e-9
        assert not (missing & ~problem.equality).any()
        if not knobs.contradiction:
            assert np.count_nonzero(missing) == knobs.blocked


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rank": 0.0}, "rank of a random"),
        ({"equalities": ()}, "levels of a random"),
        ({"active": 11}, "together of a random.*got 21; wanted at most the 20"),
    ],
)
def test_knobs_that_cannot_be_right_are_refused(changes, message):
    with pytest.raises(ConfigurationError, match=message):
        replace(SMALL, **changes)


@pytest.mark.parametrize(("changes", "ticks"), [(0.1, 31), (4.0, 15)])
def test_as_many_rows_change_a_tick_as_were_asked_for(changes, ticks):
    solver, sides, points = LexicographicSolver(), [], []
    for problem in drifting_problems(Drift(changes=changes), ticks):
        problem.validate()
        solution = solver.solve(problem)
        assert solution.ok
        assert np.count_nonzero(np.abs(solution.slacks) > 1e-9) == 2
        sides.append(solution.sides * ~problem.equality)
        points.append(solution.x)
    changed = [np.count_nonzero(a != b) for a, b in pairwise(sides)]
    if changes < 1.0:
        assert sum(changed) == round(changes * (ticks - 1))
        assert max(changed) == 1
    else:
        assert changed == [changes] * (ticks - 1)
    # It drifts: no tick takes x farther than a few hundredths of itself.
    steps = [np.linalg.norm(a - b) for a, b in pairwise(points)]
    assert 0.0 < max(steps) < 0.05 * np.linalg.norm(points[0])
