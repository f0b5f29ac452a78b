"""The reduced dynamics against Pinocchio's recursions and dense matrices, at random states."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg
from oracles import dynamics_at, moved, near_home, random_state
from stances import HUMANOIDS, STANCES, contact_rows, relative, stances

from poise.dynamics import Dynamics, Partitions, ReducedDynamics, RobotState

SEEDS = range(3)
TOLERANCE = 1e-9
ROUNDING = 1e-11
"""What is left of exact equations, whose largest differences are near 1e-13."""

everywhere = pytest.mark.parametrize(
    ("name", "stance"),
    [(name, stance) for name in HUMANOIDS for stance in STANCES]
    + [("upper17", "fixed"), ("upper17", "fixed, hand"), ("arm6", "fixed")],
)


def frames_of(robot, stance):
    if stance.startswith("fixed"):
        return (robot.hands[0],) if stance.endswith("hand") else ()
    return stances(robot)[stance]


def reduced_at(robot, stance, state):
    reduced = ReducedDynamics(robot, Partitions(robot).of(frames_of(robot, stance)))
    dynamics = dynamics_at(robot, state.q, state.v)
    reduced.update(dynamics)
    return reduced, dynamics


def acceleration(robot, seed):
    return 5.0 * np.random.default_rng(1000 + seed).normal(size=robot.nv)


@everywhere
def test_equation_of_motion_holds_for_the_true_acceleration_and_wrenches(get_robot, name, stance):
    robot = get_robot(name)
    frames = frames_of(robot, stance)
    for seed in SEEDS:
        state = random_state(robot, seed)
        reduced, dynamics = reduced_at(robot, stance, state)
        part = reduced.partition
        dv = acceleration(robot, seed)
        J, _ = contact_rows(robot, dynamics, frames)
        F = 100.0 * np.random.default_rng(seed).normal(size=len(J))
        # The forces of the joints, by inverse dynamics; zero for the base only if F is right.
        tau = pin.rnea(robot.model, robot.model.createData(), state.q, state.v, dv) - J.T @ F
        assert np.array_equal(J[:, part.u], np.zeros((len(J), part.nu)))
        x = reduced.reduce(dv)
        rows_a = reduced.forces_a(x) - J[:, part.a].T @ F
        rows_u = reduced.torques_u(x[: part.na], dv[part.u])
        assert relative(part.merge(rows_a, rows_u), tau) < ROUNDING


@everywhere
def test_accelerations_of_com_and_momentum_follow_from_the_reduced_acceleration(
    get_robot, name, stance
):
    robot = get_robot(name)
    model = robot.model
    for seed in SEEDS:
        state = random_state(robot, seed)
        reduced, dynamics = reduced_at(robot, stance, state)
        dv = acceleration(robot, seed)
        x = reduced.reduce(dv)
        data = model.createData()
        pin.centerOfMass(model, data, state.q, state.v, dv)
        J, _ = contact_rows(robot, dynamics, frames_of(robot, stance))
        contacts = np.ones((len(J), len(x)))
        reduced.reduced_jacobian(J, contacts)
        # Frames of the constraint chain do not move with the centroids.
        assert np.array_equal(contacts[:, : reduced.partition.na], J[:, reduced.partition.a])
        assert not contacts[:, reduced.partition.na :].any()
        com = np.zeros((3, len(x)))
        reduced.reduced_jacobian(dynamics.com_jacobian, com)
        assert relative(com @ x + dynamics.com_bias, data.acom[0]) < ROUNDING
        pin.computeCentroidalMomentumTimeVariation(model, data, state.q, state.v, dv)
        momentum = np.zeros((6, len(x)))
        reduced.reduced_jacobian(dynamics.momentum_matrix, momentum)
        assert relative(momentum @ x + dynamics.momentum_bias, data.dhg.vector) < ROUNDING


@everywhere
def test_reduced_mass_matrix_is_that_of_the_projected_dynamics(get_robot, name, stance):
    """Equation (14a) of Ahn et al. 2024, with M inverted."""
    robot = get_robot(name)
    for seed in SEEDS:
        reduced, dynamics = reduced_at(robot, stance, random_state(robot, seed))
        part = reduced.partition
        J_r = np.zeros((part.nr, robot.nv))
        J_r[np.arange(part.na), part.a] = 1.0
        J_r[part.na :, part.u] = reduced.J_z
        expected = np.linalg.inv(J_r @ np.linalg.solve(dynamics.M, J_r.T))
        assert relative(reduced.M, expected) < TOLERANCE
        assert np.array_equal(reduced.M, reduced.M.T)


@everywhere
def test_recovered_acceleration_has_the_least_energy_for_its_reduced_one(get_robot, name, stance):
    robot = get_robot(name)
    for seed in SEEDS:
        reduced, dynamics = reduced_at(robot, stance, random_state(robot, seed))
        part = reduced.partition
        x = np.random.default_rng(seed).normal(size=part.nr)
        dv = reduced.recover(x)
        assert relative(reduced.reduce(dv), x) < ROUNDING
        # The energy's gradient has no part along what leaves (dv_a, z) as it is.
        inside = scipy.linalg.null_space(reduced.J_z) if part.nu else np.zeros((0, 0))
        gradient = (dynamics.M @ dv)[part.u]
        assert np.abs(inside.T @ gradient).max(initial=0.0) < ROUNDING * np.abs(dv).max() * 100.0
        assert dv @ dynamics.M @ dv == pytest.approx(x @ reduced.M @ x, rel=ROUNDING)


@everywhere
def test_motions_inside_the_chains_have_unit_energy_and_are_felt_by_nobody(get_robot, name, stance):
    robot = get_robot(name)
    for seed in SEEDS:
        reduced, dynamics = reduced_at(robot, stance, random_state(robot, seed))
        part, N_z = reduced.partition, reduced.N_z
        both = np.hstack((reduced.Jbar_z, N_z))
        assert both.shape == (part.nu, part.nu)
        assert np.abs(both.T @ reduced.M_uu @ both - np.eye(part.nu)).max(initial=0.0) < ROUNDING
        assert np.abs(reduced.J_z @ N_z).max(initial=0.0) < ROUNDING
        assert np.abs(reduced.M_au @ N_z).max(initial=0.0) < ROUNDING * np.abs(dynamics.M).max()
        com = dynamics.com_jacobian[:, part.u] @ N_z
        assert np.abs(com).max(initial=0.0) < ROUNDING


@pytest.mark.parametrize("stance", STANCES)
def test_update_leaves_nothing_of_the_last_state_and_keeps_its_arrays(get_robot, stance):
    robot = get_robot("humanoid33")
    reduced, _ = reduced_at(robot, stance, random_state(robot, 0))
    names = ("M", "M_aa", "C", "M_au", "M_uu", "h_a", "h_u")
    arrays = [getattr(reduced, n) for n in names]
    state = random_state(robot, 1)
    reduced.update(dynamics_at(robot, state.q, state.v))
    fresh, _ = reduced_at(robot, stance, state)
    for n, array in zip(names, arrays, strict=True):
        assert getattr(reduced, n) is array
        assert np.array_equal(array, getattr(fresh, n)), n
    for n in ("J_z", "Jbar_z", "N_z"):
        assert np.array_equal(getattr(reduced, n), getattr(fresh, n)), n


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("name", HUMANOIDS)
@pytest.mark.parametrize("stance", ["double support", "hand contact"])
def test_centroids_move_on_smoothly_from_tick_to_tick(get_robot, name, stance):
    """A solver that starts from its last point must not find the coordinates turned over."""
    robot = get_robot(name)
    state = near_home(robot, 0, spread=0.3, speed=1.0)
    step, last, jumps = 1e-3, None, []
    for k in range(200):
        q = moved(robot, state.q, k * step * state.v)
        reduced, _ = reduced_at(robot, stance, RobotState(q, state.v))
        if last is not None:
            jumps.append(relative(reduced.C[:6], last))
        last = reduced.C[:6].copy()
    assert max(jumps) < 0.05


@pytest.mark.parametrize("name", HUMANOIDS)
def test_a_straight_arm_that_cannot_push_along_itself_loses_nothing(get_robot, name):
    """At zero angles a hanging arm makes no vertical force, and the weight of y has no bound."""
    robot = get_robot(name)
    q = robot.q_home.copy()
    q[7:] = 0.0
    state = RobotState(q, random_state(robot, 0).v)
    reduced, dynamics = reduced_at(robot, "hand contact", state)
    part = reduced.partition
    dv = acceleration(robot, 0)
    x = reduced.reduce(dv)
    expected = dynamics.M @ dv + dynamics.h
    actual = part.merge(reduced.forces_a(x), reduced.torques_u(x[: part.na], dv[part.u]))
    assert relative(actual, expected) < ROUNDING
    assert relative(reduced.J_z @ reduced.Jbar_z, np.eye(part.nz)) < ROUNDING
    assert np.abs(reduced.Jbar_z).max() < 100.0


def with_empty_arm(robot, armature):
    """The robot with right arm and neck that weigh nothing."""
    model = robot.model.copy()
    for joint in range(1, model.njoints):
        name = model.names[joint]
        if name.startswith(("right_", "neck")) and not any(
            part in name for part in ("hip", "knee", "ankle")
        ):
            model.inertias[joint] = pin.Inertia.Zero()
            rotors = model.armature.copy()
            rotors[model.idx_vs[joint]] = armature
            model.armature = rotors
    return replace(robot, model=model)


def test_a_massless_branch_with_rotors_is_exact(get_robot):
    """It makes no wrench at all: its centroid is a motion inside it, and nobody feels it."""
    robot = with_empty_arm(get_robot("humanoid33"), 0.01)
    for seed in SEEDS:
        reduced, dynamics = reduced_at(robot, "hand contact", random_state(robot, seed))
        part = reduced.partition
        dv = acceleration(robot, seed)
        x = reduced.reduce(dv)
        expected = dynamics.M @ dv + dynamics.h
        actual = part.merge(reduced.forces_a(x), reduced.torques_u(x[: part.na], dv[part.u]))
        assert np.abs(actual - expected).max() < ROUNDING * np.abs(expected).max()
        assert np.abs(reduced.C).max() < 1e-12
        least = reduced.recover(x)
        assert least @ dynamics.M @ least <= dv @ dynamics.M @ dv


def test_a_branch_that_moves_without_inertia_gives_nan_and_raises_nothing(get_robot):
    robot = with_empty_arm(get_robot("humanoid33"), 0.0)
    state = random_state(robot, 0)
    reduced, dynamics = reduced_at(robot, "hand contact", state)
    assert np.isnan(reduced.C[:6]).all()
    assert np.isnan(reduced.J_z).all()
    assert np.isnan(reduced.N_z).any()
    assert np.array_equal(reduced.M_aa, dynamics.M[np.ix_(*[reduced.partition.a] * 2)])
    # Where its joints carry a contact or none of them is reduced, nothing is missing.
    whole, _ = reduced_at(robot, "everything", state)
    assert np.isfinite(whole.M).all()


def test_a_state_that_is_not_finite_raises_nothing_and_the_next_one_is_right(get_robot):
    robot = get_robot("humanoid33")
    reduced = ReducedDynamics(robot, Partitions(robot).of(robot.soles))
    dynamics = Dynamics(robot)
    state = random_state(robot, 0)
    dynamics.update(RobotState(np.full(robot.nq, np.nan), state.v))
    reduced.update(dynamics)
    assert np.isnan(reduced.M).any()
    dynamics.update(state)
    reduced.update(dynamics)
    fresh, _ = reduced_at(robot, "double support", state)
    assert np.array_equal(reduced.M, fresh.M)


def test_without_an_unconstrained_chain_the_reduced_robot_is_the_robot(get_robot):
    robot = get_robot("humanoid33")
    reduced, dynamics = reduced_at(robot, "everything", random_state(robot, 0))
    dv = acceleration(robot, 0)
    assert np.array_equal(reduced.M, dynamics.M)
    assert np.array_equal(reduced.h_a, dynamics.h)
    assert np.array_equal(reduced.reduce(dv), dv)
    assert np.array_equal(reduced.recover(dv), dv)
