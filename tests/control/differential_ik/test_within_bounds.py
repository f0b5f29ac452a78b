"""Joints inside their bounds in the closed form, and the bounds themselves."""

import numpy as np
import pytest
from velocity_levels import solve_levels, solve_within_bounds, stacked

from poise.control._differential_ik._bounds import VelocityBounds
from poise.control._differential_ik._closed_form import RANK, ClosedForm, WithinBounds
from poise.control._differential_ik._kernels import PriorityRows
from poise.hqp import HierarchicalProblem, Level, solve
from poise.stack import JointLimit


def levels_of(rng, n, sizes):
    return [
        PriorityRows(rng.normal(size=(m, n)), rng.normal(size=m), np.full(m, 1e4), np.ones(m))
        for m in sizes
    ]


@pytest.mark.parametrize("seed", range(10))
def test_wide_bounds_change_nothing(seed):
    rng = np.random.default_rng(seed)
    levels, wide = levels_of(rng, 12, (3, 3, 8)), np.full(12, 1e3)
    u, held = solve_within_bounds(levels, np.ones(12), -wide, wide, exact=2)
    assert not held.any()
    assert (u == solve_levels(levels, np.ones(12), exact=2)).all()


@pytest.mark.parametrize("seed", range(200))
def test_joints_never_leave_their_bounds_and_contacts_never_slip(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(8, 16))
    levels = levels_of(rng, n, (6, int(rng.integers(1, 6)), int(rng.integers(1, 9))))
    levels[0].velocity[:] = 0.0
    lower, upper = -rng.uniform(0.0, 1.0, size=n), rng.uniform(0.0, 1.0, size=n)
    # Some joints stand at a limit.
    upper[rng.random(n) < 0.1] = 0.0
    u, _ = solve_within_bounds(levels, np.ones(n), lower, upper, exact=2)
    assert (u >= lower).all()
    assert (u <= upper).all()
    assert np.abs(levels[0].jacobian @ u).max() < 2e-6


@pytest.mark.parametrize("seed", range(100))
def test_lower_levels_never_cost_the_first_one_what_it_could_have(seed):
    """The first level alone, within the same bounds, is not served better."""
    rng = np.random.default_rng(seed)
    levels = levels_of(rng, 10, (4, 3, 8))
    bound = np.full(10, 0.5)
    u, _ = solve_within_bounds(levels, np.ones(10), -bound, bound)
    alone, _ = solve_within_bounds(levels[:1], np.ones(10), -bound, bound)

    def missed(x):
        return np.linalg.norm(levels[0].jacobian @ x - levels[0].velocity)

    assert missed(u) <= missed(alone) + 2e-3


def test_the_last_level_is_let_go_where_that_serves_an_exact_one():
    """Contacts that stand still, an exact level, and one that spends its joints below it."""
    served = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        levels, bound = levels_of(rng, 10, (3, 3, 8)), np.full(10, 0.5)
        levels[0].velocity[:] = 0.0
        within, found = WithinBounds(ClosedForm(10, RANK)), stacked(levels, 2)
        within.solve(found, found.with_limits(), np.ones(10), -bound, bound)
        with_all, _ = within._hold(found, 3)
        if np.abs(levels[0].jacobian @ with_all).max() > 1e-7:
            continue
        u, _ = solve_within_bounds(levels, np.ones(10), -bound, bound, exact=2)
        missed, before = (
            np.linalg.norm(levels[1].jacobian @ x - levels[1].velocity) for x in (u, with_all)
        )
        assert missed <= before + 1e-9, seed
        served += missed < before - 1e-2
    assert served > 5


def test_holding_joints_misses_little_more_than_the_optimum_must():
    """Where a level asks for several times what the bounds allow, 11% more in the mean."""
    found, best = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        (first,) = levels_of(rng, 10, (4,))
        bound = np.full(10, 0.15)
        u, held = solve_within_bounds([first], np.ones(10), -bound, bound)
        if not held.any():
            continue
        # The bounds are hard: they stand in a level of their own.
        hard = Level(np.eye(10), -bound, bound)
        soft = Level(first.jacobian, first.velocity, first.velocity)
        x = solve(HierarchicalProblem([hard, soft])).x
        found.append(np.linalg.norm(first.jacobian @ u - first.velocity))
        best.append(np.linalg.norm(first.jacobian @ x - first.velocity))
    found, best = np.array(found), np.array(best)
    assert len(found) > 50
    assert (found >= best - 1e-6).all()
    assert found.mean() < 1.2 * best.mean()


@pytest.fixture
def bounds(get_robot):
    robot = get_robot("biped20")
    limit = JointLimit()
    limit.bind(robot)
    return robot, VelocityBounds(robot, limit, 0.01, np.arange(robot.nj))


def test_bounds_are_limits_over_the_time(bounds):
    robot, bound = bounds
    q = robot.q_home[7:]
    lower, upper = bound.at(q)
    assert np.allclose(lower, np.maximum(-robot.v_max, (robot.q_min + 0.01 - q) / 0.01), atol=1e-9)
    assert np.allclose(upper, np.minimum(robot.v_max, (robot.q_max - 0.01 - q) / 0.01), atol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_bounds_never_cross_and_never_exceed_the_velocity_limits(bounds, seed):
    robot, bound = bounds
    rng = np.random.default_rng(seed)
    q = rng.uniform(-2.0, 2.0, size=robot.nj) * 10.0 ** rng.uniform(-2, 3)
    lower, upper = bound.at(q)
    assert (lower <= upper).all()
    assert (np.abs(lower) <= robot.v_max).all()
    assert (np.abs(upper) <= robot.v_max).all()
    beyond = q > robot.q_max
    assert (upper[beyond] < 0.0).all()
    below = q < robot.q_min
    assert (lower[below] > 0.0).all()
