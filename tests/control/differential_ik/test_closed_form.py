"""The closed form against the paper's own formula, and against other optimisers."""

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import minimize
from velocity_levels import solve_levels, stacked

from poise.control._differential_ik._closed_form import (
    RANK,
    ClosedForm,
    right_inverse,
    robust_step,
)
from poise.control._differential_ik._kernels import PriorityRows


def level(rng, m, n, jacobian=None):
    J = rng.normal(size=(m, n)) if jacobian is None else jacobian
    return PriorityRows(
        J, rng.normal(size=m), 10.0 ** rng.uniform(-1, 3, size=m), np.ones(m) / np.sqrt(n)
    )


def paper_solution(first, second, wb):
    """(21) with (22), as they are printed."""
    J1, v1 = first.jacobian, first.velocity
    J2, v2, WA = second.jacobian, second.velocity, np.diag(second.weight)
    half = np.diag(wb**-0.5)
    J1W, J2W = J1 @ half, J2 @ half
    J1p = J1W.T @ np.linalg.inv(J1W @ J1W.T)
    J2t = J2W @ (np.eye(len(wb)) - J1p @ J1W)
    J2s = np.linalg.inv(J2t.T @ WA @ J2t + np.eye(len(wb))) @ J2t.T @ WA
    return half @ J1p @ v1 + half @ J2s @ (v2 - J2W @ J1p @ v1)


@pytest.mark.parametrize("seed", range(20))
def test_two_levels_are_the_formula_of_the_paper(seed):
    rng = np.random.default_rng(seed)
    levels = [level(rng, 6, 12), level(rng, 8, 12)]
    wb = rng.uniform(1.0, 20.0, size=12)
    u = solve_levels(levels, wb)
    assert np.abs(u - paper_solution(*levels, wb)).max() < 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_two_levels_solve_the_optimisation_problem(seed):
    rng = np.random.default_rng(seed)
    first, second = level(rng, 3, 7), level(rng, 5, 7)
    wb = rng.uniform(1.0, 20.0, size=7)

    def cost(u):
        e = second.jacobian @ u - second.velocity
        return e @ (second.weight * e) + u @ (wb * u)

    def gradient(u):
        e = second.jacobian @ u - second.velocity
        return 2.0 * (second.jacobian.T @ (second.weight * e) + wb * u)

    found = minimize(
        cost, np.zeros(7), jac=gradient, method="SLSQP", options={"ftol": 1e-14, "maxiter": 500},
        constraints={
            "type": "eq", "fun": lambda u: first.jacobian @ u - first.velocity,
            "jac": lambda u: first.jacobian,
        },
    )  # fmt: skip
    u = solve_levels([first, second], wb)
    assert np.abs(first.jacobian @ u - first.velocity).max() < 1e-10
    assert cost(u) <= cost(found.x) * (1.0 + 1e-9)
    assert np.abs(u - found.x).max() < 1e-4


@pytest.mark.parametrize("seed", range(10))
def test_a_qp_solver_agrees(seed):
    qpsolvers = pytest.importorskip("qpsolvers")
    rng = np.random.default_rng(seed)
    first, second = level(rng, 6, 12), level(rng, 8, 12)
    wb = rng.uniform(1.0, 5.0, size=12)
    H = second.jacobian.T @ (second.weight[:, None] * second.jacobian) + np.diag(wb)
    g = -second.jacobian.T @ (second.weight * second.velocity)
    x = qpsolvers.solve_qp(H, g, A=first.jacobian, b=first.velocity, solver="daqp")
    assert np.abs(solve_levels([first, second], wb) - x).max() < 1e-6


@pytest.mark.parametrize("seed", range(10))
def test_further_levels_act_in_the_null_space_of_all_above(seed):
    """Against a basis of each null space, and least squares with damping on it."""
    rng = np.random.default_rng(seed)
    levels = [level(rng, 3, 12), level(rng, 4, 12), level(rng, 2, 12), level(rng, 9, 12)]
    wb = rng.uniform(1.0, 5.0, size=12)
    half = np.diag(wb**-0.5)
    z, stacked = np.zeros(12), np.zeros((0, 12))
    for i, (J, v, w, _) in enumerate(levels):
        JW = J @ half
        Z = null_space(stacked) if len(stacked) else np.eye(12)
        A, r = JW @ Z, v - JW @ z
        if i == 0:
            z = z + Z @ np.linalg.lstsq(A, r, rcond=None)[0]
        else:
            z = z + Z @ np.linalg.solve(A.T @ np.diag(w) @ A + np.eye(Z.shape[1]), A.T @ (w * r))
        stacked = np.vstack((stacked, JW))
    assert np.abs(solve_levels(levels, wb) - half @ z).max() < 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_a_level_below_changes_nothing_above(seed):
    rng = np.random.default_rng(seed)
    levels = [level(rng, m, 14) for m in (3, 4, 3, 8)]
    wb = rng.uniform(1.0, 20.0, size=14)
    all_of_them = solve_levels(levels, wb)
    for depth in (1, 2, 3):
        upper = solve_levels(levels[:depth], wb)
        for upper_level in levels[:depth]:
            assert np.abs(upper_level.jacobian @ (all_of_them - upper)).max() < 1e-10


def test_levels_without_rows_are_passed_over():
    rng = np.random.default_rng(0)
    first, second = level(rng, 3, 7), level(rng, 5, 7)
    empty = PriorityRows(np.zeros((0, 7)), np.zeros(0), np.zeros(0), np.zeros(0))
    wb = np.ones(7)
    u = solve_levels([first, second], wb)
    for levels in ([empty, first, second], [empty, first, empty, second, empty]):
        assert np.abs(solve_levels(levels, wb, exact=2) - u).max() < 1e-12
    assert not solve_levels([empty], wb).any()


def test_a_joint_of_infinite_weight_stays_where_it_is():
    rng = np.random.default_rng(1)
    levels = [level(rng, 3, 7), level(rng, 5, 7)]
    wb = np.ones(7)
    wb[2] = np.inf
    u = solve_levels(levels, wb)
    assert u[2] == 0.0
    assert np.abs(levels[0].jacobian @ u - levels[0].velocity).max() < 1e-10


@pytest.mark.parametrize("exact", [1, 2])
@pytest.mark.parametrize("seed", range(10))
def test_velocities_stay_bounded_on_the_way_through_a_loss_of_rank(seed, exact):
    rng = np.random.default_rng(seed)
    J1, J2 = rng.normal(size=(4, 9)) / 3.0, rng.normal(size=(5, 9)) / 3.0
    direction = rng.normal(size=9) / 3.0
    first = PriorityRows(J1, rng.normal(size=4), np.full(4, 1e4), np.ones(4))
    second = PriorityRows(J2, rng.normal(size=5), np.full(5, 1e4), np.ones(5))
    largest = 0.0
    for distance in (*np.logspace(0, -12, 100), 0.0):
        # Two rows of each level, and a row of the second with the first, become one.
        J1[3] = J1[2] + distance * direction
        J2[1] = J2[0] + distance * direction
        J2[2] = J1[0] + distance * direction
        u = solve_levels([first, second], np.ones(9), exact=exact)
        largest = max(largest, float(np.abs(u).max()))
        assert np.isfinite(u).all()
    # One over the low threshold bounds what a unit of velocity may cost in any one direction.
    asked = np.linalg.norm(first.velocity) + np.linalg.norm(second.velocity)
    assert largest < 2.0 * asked / RANK.low


def test_velocities_are_continuous_through_a_loss_of_rank():
    rng = np.random.default_rng(3)
    J1, J2 = rng.normal(size=(3, 7)) / 3.0, rng.normal(size=(5, 7)) / 3.0
    direction = rng.normal(size=7) / 3.0
    first = PriorityRows(J1, rng.normal(size=3), np.full(3, 1e4), np.ones(3))
    second = PriorityRows(J2, rng.normal(size=5), np.full(5, 1e4), np.ones(5))

    def at(distance):
        J1[2] = J1[1] + distance * direction
        return solve_levels([first, second], np.ones(7))

    jumps = []
    for steps in (1000, 5000):
        path = np.array([at(d) for d in np.linspace(-0.05, 0.05, steps)])
        jumps.append(np.abs(np.diff(path, axis=0)).max())
    # A step of a fifth gives a jump of a fifth: no jump is left in the limit.
    assert jumps[1] < 0.3 * jumps[0]


def test_rows_that_nothing_moves_are_left_alone():
    rng = np.random.default_rng(4)
    J = rng.normal(size=(3, 6))
    J[1] = 0.0
    first = PriorityRows(J, np.array([0.1, 5.0, -0.2]), np.ones(3), np.ones(3))
    second = level(rng, 4, 6)
    u = solve_levels([first, second], np.ones(6))
    assert np.abs((J @ u - first.velocity)[[0, 2]]).max() < 1e-10
    assert np.abs(u).max() < 100.0


@pytest.mark.parametrize("seed", range(10))
def test_the_right_inverse_is_numpys_where_there_is_one(seed):
    rng = np.random.default_rng(seed)
    J, v = rng.normal(size=(6, 12)), rng.normal(size=6)
    step, filled = right_inverse(J, v, np.full(6, 0.3), RANK)
    assert np.abs(step - np.linalg.pinv(J) @ v).max() < 1e-10
    assert np.abs(filled - np.linalg.pinv(J) @ J).max() < 1e-10


@pytest.mark.parametrize("seed", range(20))
def test_the_robust_step_is_as_short_as_its_docstring_says(seed):
    rng = np.random.default_rng(seed)
    m, n = rng.integers(1, 12, size=2)
    J = 10.0 ** rng.uniform(-8, 3) * rng.normal(size=(m, n))
    v, w = rng.normal(size=m), 10.0 ** rng.uniform(-3, 6)
    step = robust_step(J, v, np.full(m, w))
    assert np.linalg.norm(step) <= 0.5 * np.sqrt(w) * np.linalg.norm(v) * (1.0 + 1e-9)


@pytest.mark.parametrize("sizes", [(3, 2, 4), (6, 0, 3, 12), (2, 2), (5, 3, 2, 2), (0, 12)])
@pytest.mark.parametrize("exact", [1, 2])
def test_projectors_and_eigenvalues_give_what_the_compiled_levels_do(sizes, exact):
    """The way of levels that lose rank, taken by levels that keep it."""
    rng = np.random.default_rng(7)
    levels = stacked([level(rng, m, 12) for m in sizes], exact)
    form, wb = ClosedForm(12, RANK), rng.uniform(1.0, 20.0, size=12)
    u = form.solve(levels, wb)
    form.solve(levels, wb, count=0)
    form.memory.B[:], form.memory.count = np.eye(12), len(sizes)
    assert np.abs(form._serve_lost(levels, 0) - u).max() < 1e-9


def test_joints_that_nothing_moves_rest_exactly():
    """The next tick's weights go by the signs of velocities, which rounding must not decide."""
    rng = np.random.default_rng(8)
    levels = [level(rng, m, 12) for m in (3, 4, 2)]
    for each in levels:
        each.jacobian[:, [0, 5, 7]] = 0.0
    u = solve_levels(levels, rng.uniform(1.0, 20.0, size=12), exact=2)
    assert (u[[0, 5, 7]] == 0.0).all()
    assert np.count_nonzero(u) == 9


def test_what_is_no_number_stays_none():
    rng = np.random.default_rng(9)
    for bad in range(3):
        levels = [level(rng, m, 12) for m in (3, 4, 9)]
        levels[bad].velocity[1] = np.nan
        assert np.isnan(solve_levels(levels, np.ones(12), exact=2)).any()
