"""The least acceleration energy under base dynamics, contacts and a COM task: full and reduced.

Nothing here is asked of the unconstrained chain itself, so that accelerations, wrenches and torques
of both problems must be the same.
"""

import numpy as np
import pytest
from oracles import Dynamics, random_state
from stances import HUMANOIDS, STANCES, contact_rows, relative, stances

from poise.dynamics import Partitions, ReducedDynamics

SEEDS = range(20)
TOLERANCE = 1e-9
WRENCH_COST = 1e-4
"""As in the whole-body controller: it chooses among internal forces."""


def least_cost(H, E, e):
    """The x with E x = e and the least x^T H x, by singular values of whitened rows."""
    factor = np.linalg.cholesky(H)
    whitened = np.linalg.solve(factor, E.T).T
    s, *_ = np.linalg.lstsq(whitened, e, rcond=None)
    x = np.linalg.solve(factor.T, s)
    # Otherwise there is no such x, and the comparison means nothing.
    assert np.abs(E @ x - e).max() < 1e-7 * max(1.0, np.abs(e).max())
    return x


def with_wrenches(mass, count):
    n = len(mass)
    H = np.zeros((n + count, n + count))
    H[:n, :n] = mass
    H[n:, n:] = WRENCH_COST * np.eye(count)
    return H


class Problem:
    """What is asked at one state: contacts that accelerate as they should, and a COM."""

    def __init__(self, robot, frames, seed):
        self.robot, self.dynamics = robot, Dynamics(robot)
        self.dynamics.update(random_state(robot, seed))
        self.J, drift = contact_rows(robot, self.dynamics, frames)
        self.motion = -drift
        rng = np.random.default_rng(seed)
        # With one free contact's worth of forces or none, gravity decides how the COM moves.
        self.task = self.dynamics.com_jacobian if frames else np.zeros((0, robot.nv))
        com = rng.normal(size=3) - self.dynamics.com_bias
        self.com = com if frames else np.zeros(0)

    def solve_full(self):
        """Accelerations, wrenches and torques over (dv, F)."""
        M, h, J = self.dynamics.M, self.dynamics.h, self.J
        E = np.block(
            [
                [M[:6], -J.T[:6]],
                [J, np.zeros((len(J), len(J)))],
                [self.task, np.zeros((len(self.task), len(J)))],
            ]
        )
        e = np.concatenate((-h[:6], self.motion, self.com))
        x = least_cost(with_wrenches(M, len(J)), E, e)
        dv, F = x[: self.robot.nv], x[self.robot.nv :]
        return dv, F, (M @ dv + h - J.T @ F)[6:]

    def solve_reduced(self, reduced):
        """The same over (dv_a, z, F), and the unconstrained chain recovered."""
        part = reduced.partition
        na, nr, count = part.na, part.nr, len(self.J)
        reduced.update(self.dynamics)
        J, task = np.zeros((count, nr)), np.zeros((len(self.task), nr))
        J[:, :na] = self.J[:, part.a]
        reduced.reduced_jacobian(self.task, task)
        E = np.block(
            [
                [reduced.M[:6], -J[:, :6].T],
                [J, np.zeros((count, count))],
                [task, np.zeros((len(task), count))],
            ]
        )
        e = np.concatenate((-reduced.h_a[:6], self.motion, self.com))
        solution = least_cost(with_wrenches(reduced.M, count), E, e)
        x, F = solution[:nr], solution[nr:]
        dv = reduced.recover(x)
        torque_a = reduced.forces_a(x) - J[:, :na].T @ F
        torque_u = reduced.torques_u(x[:na], dv[part.u])
        return dv, F, part.merge(torque_a, torque_u)[6:]


@pytest.mark.parametrize("stance", STANCES)
@pytest.mark.parametrize("name", HUMANOIDS)
def test_full_and_reduced_problem_have_the_same_solution(get_robot, name, stance):
    robot = get_robot(name)
    frames = stances(robot)[stance]
    reduced = ReducedDynamics(robot, Partitions(robot).of(frames))
    for seed in SEEDS:
        problem = Problem(robot, frames, seed)
        full, small = problem.solve_full(), problem.solve_reduced(reduced)
        assert relative(small[0], full[0]) < TOLERANCE
        assert not frames or relative(small[1], full[1]) < TOLERANCE
        assert relative(small[2], full[2]) < TOLERANCE


@pytest.mark.parametrize("name", HUMANOIDS)
def test_leaving_out_the_acceleration_of_the_base_costs_newton_metres(get_robot, name):
    """Equation (17) of Ahn et al. 2024 has no M_ua dv_a; the exact form here has."""
    robot = get_robot(name)
    for stance in ("double support", "left support"):
        frames = stances(robot)[stance]
        reduced = ReducedDynamics(robot, Partitions(robot).of(frames))
        u = reduced.partition.u
        missing = []
        for seed in SEEDS:
            problem = Problem(robot, frames, seed)
            dv, _, torque = problem.solve_reduced(reduced)
            papers = reduced.M_uu @ dv[u] + reduced.h_u
            missing.append(np.abs(torque[u - 6] - papers).max())
        assert np.median(missing) > 0.1
