"""The active rows of the last answer, tried again: as exact as a search, and never believed."""

import numpy as np
import pytest

from poise.hqp.hard import LARGEST_SYSTEM, HardQP
from poise.hqp.known_active import KnownActive


def moving_qp(seed, time, *, equalities=4, rows=14, n=10):
    """A strictly convex QP whose numbers move smoothly; some inequalities hold x."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((n, n))
    H = root @ root.T + 0.1 * np.eye(n)
    g = 3.0 * rng.standard_normal(n) + np.sin(time + np.arange(n))
    A = rng.standard_normal((rows, n)) * (1.0 + 0.1 * np.sin(time + np.arange(n)))
    inside = 0.2 * np.sin(time + np.arange(n))
    values = np.concatenate((inside, A @ inside))
    room = rng.uniform(0.05, 0.5, n + rows)
    room[n : n + equalities] = 0.0
    return H, g, A, values - room, values + room


def assert_optimal(qp, point):
    """The optimality conditions, dual signs included."""
    H, g, A, lower, upper = qp
    values = np.concatenate((point.x, A @ point.x))
    force = point.multipliers
    assert (values >= lower - 1e-9).all()
    assert (values <= upper + 1e-9).all()
    pull = H @ point.x + g + force[: len(g)] + force[len(g) :] @ A
    assert np.abs(pull).max() <= 1e-8 * max(1.0, np.abs(g).max())
    one_sided = lower < upper
    assert (np.abs(values - upper)[one_sided & (force > 0.0)] <= 1e-8).all()
    assert (np.abs(values - lower)[one_sided & (force < 0.0)] <= 1e-8).all()


@pytest.mark.parametrize("refines", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_a_moving_qp_is_optimal_at_every_tick_whoever_found_it(seed, refines):
    solver, repeated, searched = HardQP(refines=refines), 0, 0
    for tick in range(120):
        qp = moving_qp(seed, 0.02 * tick)
        point, fresh = solver.solve(*qp), HardQP().solve(*qp)
        assert point is not None
        assert fresh is not None
        assert_optimal(qp, point)
        np.testing.assert_allclose(point.x, fresh.x, atol=1e-8)
        np.testing.assert_allclose(point.multipliers, fresh.multipliers, atol=1e-6)
        repeated += point.iterations == 0
        searched += point.iterations > 0
    # Active rows change here now and then, and stay in between.
    assert repeated > 80
    assert searched > 1


@pytest.mark.parametrize("seed", range(10))
def test_another_gradient_equals_a_fresh_solve(seed):
    H, _, A, lower, upper = moving_qp(seed, 0.3)
    solver, rng = HardQP(), np.random.default_rng(seed)
    for _ in range(2):
        assert solver.solve(H, rng.standard_normal(10), A, lower, upper) is not None
        for scale in (0.0, 1e-3, 1.0, 10.0):
            g = scale * rng.standard_normal(10)
            point = solver.again(g)
            assert point is not None
            assert_optimal((H, g, A, lower, upper), point)


def test_far_apart_curvatures_keep_the_small_components():
    """As when a level is solved above a cost of small weight."""
    H, g, A, lower, upper = moving_qp(1, 0.0, equalities=6)
    H[:6, :6] *= 1e-9
    H[:6, 6:] = H[6:, :6] = 0.0
    found = HardQP().solve(H, g, A, lower, upper)
    assert found is not None
    again = KnownActive(found.multipliers, 10, 10, refines=True).solve(H, g, A, lower, upper)
    assert again is not None
    np.testing.assert_allclose(again[0], found.x, rtol=1e-9, atol=1e-9)


def test_an_active_row_that_would_have_to_pull_is_refused():
    H, A = np.eye(2), np.zeros((0, 2))
    known = KnownActive(np.array([2.0, 0.0]), 2, 2, refines=False)
    at = (A, np.full(2, -np.inf), np.ones(2))
    pushed = known.solve(H, np.array([-3.0, 0.0]), *at)
    assert pushed is not None
    np.testing.assert_allclose(pushed[0], [1.0, 0.0])
    assert known.solve(H, np.array([3.0, 0.0]), *at) is None


def test_a_row_that_was_not_active_is_seen_when_it_is_violated():
    H, A = np.eye(2), np.zeros((0, 2))
    known = KnownActive(np.array([2.0, 0.0]), 2, 2, refines=False)
    at = (A, np.full(2, -np.inf), np.ones(2))
    found = known.solve(H, np.array([-3.0, -3.0]), *at)
    assert found is not None
    assert not known.meets_rows(found[0])


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf, 1e308])
@pytest.mark.parametrize("where", range(5))
def test_numbers_that_are_none_give_no_point_and_no_warning(where, poison):
    qp = moving_qp(2, 0.0)
    found = HardQP().solve(*qp)
    assert found is not None
    known = KnownActive(found.multipliers, 10, 10, refines=True)
    assert known.solve(*qp) is not None
    active = int(np.flatnonzero(found.multipliers)[-1])
    bad = [array.copy() for array in qp]
    if where == 2:
        bad[where][active - 10] = poison
    elif where > 2:
        bad[3][active] = bad[4][active] = poison
    else:
        bad[where][...] = poison
    point = known.solve(*bad)
    assert point is None or np.isfinite(point[0]).all()


def test_active_rows_that_depend_on_each_other_are_left_to_the_search():
    H, g = np.eye(3), np.array([1.0, 2.0, 3.0])
    A = np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]])
    bounds = np.concatenate((np.full(3, np.inf), [1.0, 2.0]))
    lower, upper = np.where(np.isinf(bounds), -np.inf, bounds), bounds
    known = KnownActive(np.array([0.0, 0.0, 0.0, 1.0, 1.0]), 3, 3, refines=False)
    point = known.solve(H, g, A, lower, upper)
    assert point is None or abs(A[0] @ point[0] - 1.0) <= 1e-9
    assert_optimal((H, g, A, lower, upper), HardQP().solve(H, g, A, lower, upper))


def test_large_problems_are_always_searched():
    n = LARGEST_SYSTEM
    H, g = np.eye(n), np.ones(n)
    lower, upper = np.full(n, -0.5), np.full(n, 0.5)
    solver = HardQP()
    points = [solver.solve(H, g, np.zeros((0, n)), lower, upper) for _ in range(2)]
    assert all(p is not None and p.iterations > 0 for p in points)
