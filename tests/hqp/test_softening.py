"""Softened levels: their decisions, and the room that they leave to those below."""

import numpy as np
import pytest
import qpsolvers

from poise.hqp import HierarchicalProblem, Level, SoftenedSolver, make_solver

SEEDS = range(12)
STRATEGIES = ["direct", "cascade"]


def random_problem(seed, n=9):
    """Bounds on x, a limit, two levels of equalities that contradict the limits, a full level."""
    rng = np.random.default_rng(seed)
    box = Level(rng.normal(size=(2, n)), -1.0, 0.3, name="limits")
    first = Level(rng.normal(size=(3, n)), *[10.0 * rng.normal(size=3)] * 2, name="first")
    second = Level(
        rng.normal(size=(4, n)), *[10.0 * rng.normal(size=4)] * 2, rng.uniform(0.5, 2.0, 4)
    )
    last = Level(np.eye(n), *[rng.normal(size=n)] * 2, name="posture")
    problem = HierarchicalProblem(
        [box, first, second, last], x_lower=-np.ones(n), x_upper=np.ones(n)
    )
    return problem, rng.normal(size=n)


def softened(problem, reference, weights, *, levels=(1, 2), strategy="direct", tolerance=1e-9):
    n = problem.n
    solver = SoftenedSolver(
        problem,
        make_solver(strategy),
        {k: k for k in levels},
        range(n),
        weights=np.array(weights, dtype=np.float64),
        reference=reference,
        find=lambda x: float(np.max(weights) * np.linalg.norm(x - reference)),
        exact=False,
        tolerance=tolerance,
        make_solver=lambda: make_solver(strategy),
    )
    assert solver.run().ok
    return solver


def least(problem, level, weight, reference, held):
    """Values of a softened level's rows by another solver, values of rows above held."""
    view, n = problem.level(level), problem.n
    A = np.vstack([view.weights[:, None] * view.A, weight * np.eye(n)])
    b = np.concatenate([view.weights * view.lower, weight * reference])
    limits = problem.level(0)
    rows, values = held or (None, None)
    x = qpsolvers.solve_qp(
        A.T @ A,
        -A.T @ b,
        np.vstack([limits.A, -limits.A]),
        np.concatenate([limits.upper, -limits.lower]),
        rows,
        values,
        -np.ones(n),
        np.ones(n),
        solver="piqp",
        eps_abs=1e-10,
        eps_rel=1e-10,
    )
    assert x is not None
    return view.A @ x


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("seed", SEEDS)
def test_each_level_is_the_least_squares_with_its_term_under_the_levels_above(seed, strategy):
    problem, reference = random_problem(seed)
    x = softened(problem, reference, (0.7, 0.4), strategy=strategy).x
    first, second = problem.level(1).A, problem.level(2).A
    values = least(problem, 1, 0.7, reference, None)
    np.testing.assert_allclose(first @ x, values, atol=3e-5)
    wanted = least(problem, 2, 0.4, reference, (first, first @ x))
    np.testing.assert_allclose(second @ x, wanted, atol=3e-5)


@pytest.mark.parametrize("seed", SEEDS)
def test_levels_below_cost_a_softened_level_nothing(seed):
    problem, reference = random_problem(seed)
    before = problem.level(1).A @ softened(problem, reference, (0.7, 0.4)).x
    lower = problem.level(2)
    lower.lower[:] = lower.upper[:] = 1000.0 * lower.lower
    after = problem.level(1).A @ softened(problem, reference, (0.7, 0.4)).x
    np.testing.assert_allclose(after, before, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_reference_costs_no_more_than_its_distance_times_the_weight(seed):
    problem, reference = random_problem(seed)
    strict = make_solver().solve(problem)
    solution = softened(problem, reference, (0.7, 0.4)).report()
    distance = np.linalg.norm(strict.x - reference)
    assert strict.residuals[1] ** 2 <= solution.residuals[1] ** 2 + 1e-9
    assert solution.residuals[1] ** 2 <= strict.residuals[1] ** 2 + (0.7 * distance) ** 2 + 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_weights_of_zero_leave_every_bit_as_it_is(seed):
    problem, reference = random_problem(seed)
    solver = softened(problem, reference, (0.0, 0.0))
    assert solver.x.tobytes() == make_solver().solve(problem).x.tobytes()
    assert not solver.softened.any()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_term_below_the_tolerance_is_left_out_and_one_above_it_is_not(seed):
    problem, reference = random_problem(seed)
    strict = make_solver().solve(problem)
    most = 0.1 * np.linalg.norm(strict.x - reference)
    left_out = softened(problem, reference, (0.0, 0.1), tolerance=1.01 * most)
    assert left_out.x.tobytes() == strict.x.tobytes()
    kept = softened(problem, reference, (0.0, 0.1), tolerance=0.99 * most)
    assert kept.softened.tolist() == [0.0, 0.1]


@pytest.mark.timeout(60)
@pytest.mark.parametrize("weights", [(0.0, 0.0), (0.0, 0.4)])
def test_a_reference_whose_distance_overflows_leaves_the_levels_strict(weights):
    problem, _ = random_problem(0)
    with np.errstate(over="ignore", invalid="ignore"):  # of the test's own distance
        solver = softened(problem, np.full(problem.n, 1e200), weights)
    np.testing.assert_allclose(solver.x, make_solver().solve(problem).x, atol=1e-6)
    assert not solver.softened.any()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_problem_is_as_it_was_and_residuals_are_those_of_what_was_wanted(seed):
    problem, reference = random_problem(seed)
    before = problem.lower.copy(), problem.upper.copy(), problem.A.copy()
    solver = softened(problem, reference, (0.7, 0.4))
    for was, now in zip(before, (problem.lower, problem.upper, problem.A), strict=True):
        assert was.tobytes() == now.tobytes()
    wanted = problem.level(1)
    missed = np.linalg.norm(wanted.A @ solver.x - wanted.lower)
    assert solver.report().residuals[1] == pytest.approx(missed)
    assert solver.relative_residuals[1] == pytest.approx(missed / np.linalg.norm(wanted.lower))


def test_a_level_that_cannot_be_met_moves_little_where_its_rows_turn():
    """Near a singularity the strict answer jumps from bound to bound, the softened one does not."""

    def answers(weight):
        found = []
        for angle in (-1e-6, 1e-6):
            rows = np.array([[1.0, 0.0], [1.0, angle]])
            level = Level(rows, [0.0, 1.0], [0.0, 1.0])
            problem = HierarchicalProblem(
                [Level(np.zeros((0, 2)), 0.0, 0.0), level, Level(np.eye(2), 0.0, 0.0)],
                x_lower=[-50.0, -50.0],
                x_upper=[50.0, 50.0],
            )
            found.append(softened(problem, np.zeros(2), (weight,), levels=(1,)).x.copy())
        return np.abs(found[1] - found[0]).max()

    assert answers(0.0) > 99.0
    assert answers(0.05) < 1e-3
