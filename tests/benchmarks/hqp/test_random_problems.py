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
from benchmarks.hqp.random_problems import Knobs, random_hierarchy
from poise.errors import ConfigurationError
from poise.hqp import LexicographicSolver

TURNS = (turn_rank, turn_condition, turn_conflict, turn_contradiction, turn_active)
COUNT, MANY = 6, 12
SMALL = Knobs(variables=20, limits=12, equalities=(4, 6), inequalities=(3, 5), active=3)


@pytest.fixture(scope="module", params=TURNS, ids=lambda turn: turn.__name__)
def family(request):
    """Knobs, problems and solutions from a cold start."""
    solver, turn = LexicographicSolver(), request.param
    problems = list(random_problems(turn, 7, COUNT))
    solutions = []
    for problem in problems:
        solver.reset()
        solutions.append(solver.solve(problem))
    knobs = [family_knobs(turn, 7, i) for i in range(COUNT)]
    return list(zip(knobs, problems, solutions, strict=True))


def task_equalities(knobs, problem):
    return [level.A[:m] for level, m in zip(problem.levels[1:], knobs.equalities, strict=True) if m]


def test_problems_are_legal_and_of_a_humanoids_size(family):
    for _, problem, _ in family:
        problem.validate()
        assert 20 <= problem.n <= 80
        assert 50 <= problem.m <= 200
        assert 2 <= len(problem.levels) <= 6


def test_the_solver_finds_all_of_them(family):
    assert sum(solution.ok for _, _, solution in family) == COUNT


def test_equalities_have_the_rank_that_was_asked_for(family):
    for knobs, problem, _ in family:
        for E, rank in zip(task_equalities(knobs, problem), knobs.ranks, strict=True):
            assert np.linalg.matrix_rank(E, tol=1e-10) == rank
            assert rank == max(1, round(knobs.rank * len(E)))


def test_equalities_have_the_condition_number_that_was_asked_for(family):
    for knobs, problem, _ in family:
        for E, rank in zip(task_equalities(knobs, problem), knobs.ranks, strict=True):
            values = np.linalg.svd(E, compute_uv=False)
            if rank > 1:
                assert values[0] / values[rank - 1] == pytest.approx(knobs.condition, rel=1e-6)


def test_as_many_inequalities_are_active_as_were_asked_for(family):
    for knobs, problem, solution in family:
        active = (solution.sides != 0) & ~problem.equality
        assert np.count_nonzero(active) == knobs.active


def test_as_many_equalities_miss_as_were_asked_for_and_no_inequality(family):
    for knobs, problem, solution in family:
        missing = np.abs(solution.slacks) > 1e-9
        assert not (missing & ~problem.equality).any()
        if knobs.contradiction == 0.0:
            assert np.count_nonzero(missing) == knobs.blocked


def test_equalities_miss_by_the_contradiction_that_was_asked_for(family):
    for knobs, problem, solution in family:
        if knobs.contradiction == 0.0:
            continue
        for level, m, rank in zip(problem.levels[1:], knobs.equalities, knobs.ranks, strict=True):
            rows = slice(problem.n + level.slice.start, problem.n + level.slice.start + m)
            pull = problem.weights[rows] ** 2 * solution.slacks[rows]
            expected = knobs.contradiction if m > rank else 0.0
            assert np.linalg.norm(pull) == pytest.approx(expected, rel=1e-6, abs=1e-9)
            # It is one: no motion makes the weighted slack smaller.
            np.testing.assert_allclose(level.A[:m].T @ pull, 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("turn", "knob", "values"),
    [
        (turn_rank, "rank", {0.5, 0.7, 0.9, 1.0}),
        (turn_condition, "condition", {1e1, 1e2, 1e3, 1e4, 1e5, 1e6}),
        (turn_conflict, "blocked", {1, 2, 4, 6}),
        (turn_contradiction, "contradiction", {1e-3, 1e-1, 1e1}),
    ],
)
def test_a_family_goes_through_what_it_is_about(turn, knob, values):
    assert {getattr(family_knobs(turn, 0, i), knob) for i in range(MANY)} == values


def test_active_inequalities_go_from_none_to_more_than_half_of_the_variables():
    knobs = [family_knobs(turn_active, 0, i) for i in range(MANY)]
    assert {round(k.active / k.variables, 1) for k in knobs} == {0.0, 0.1, 0.2, 0.4, 0.6}


@pytest.mark.parametrize("turn", TURNS)
def test_a_shorter_sequence_is_the_beginning_of_a_longer_one(turn):
    short, long = (list(random_problems(turn, 3, count)) for count in (2, 4))
    for one, other in zip(short, long, strict=False):
        assert one.A.tobytes() == other.A.tobytes()
        assert one.lower.tobytes() == other.lower.tobytes()


def test_the_solution_that_a_hierarchy_is_made_around_is_the_solvers():
    made = random_hierarchy(np.random.default_rng(0), replace(SMALL, blocked=1))
    problem = made.problem
    solution = LexicographicSolver().solve(problem)
    np.testing.assert_allclose(solution.x, made.x, atol=1e-9)
    pull = made.multipliers[: problem.n] + problem.A.T @ made.multipliers[problem.n :]
    np.testing.assert_allclose(problem.H @ made.x + problem.g + pull, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rank": 0.0}, "rank of a random"),
        ({"condition": 0.5}, "condition of a random"),
        ({"weight_range": 0.1}, "weight_range of a random"),
        ({"equalities": ()}, "levels of a random"),
        ({"inequalities": (1,)}, "levels of a random"),
        ({"blocked": 11, "limits": 40}, "blocked of a random"),
        ({"blocked": 7}, "limits of a random"),
        ({"contradiction": 1.0}, "contradiction of a random"),
        ({"blocked": 2}, "active of a random.*wanted 4 to"),
        ({"active": 11}, "together of a random.*got 21; wanted at most the 20"),
    ],
)
def test_knobs_that_cannot_be_right_are_refused(changes, message):
    with pytest.raises(ConfigurationError, match=message):
        replace(SMALL, **changes)


@pytest.mark.parametrize(("changes", "ticks"), [(0.1, 31), (1.0, 30), (4.0, 15)])
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


@pytest.mark.parametrize("changes", [0.0, 7.0])
def test_a_drift_that_cannot_be_is_refused(changes):
    with pytest.raises(ConfigurationError, match="changes a tick"):
        Drift(changes=changes)
