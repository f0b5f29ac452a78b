"""The reduced dynamics as Ahn et al. 2024 write them, (8) to (17) and (19) to (22), as a reference.

The mass matrix is inverted and the centroid is that of the unconstrained chain's own bodies,
relative to the base: nothing of it is shared with `ReducedDynamics`.
"""

import numpy as np
import pinocchio as pin
import pytest
from oracles import Dynamics, moved, random_state
from stances import HUMANOIDS, contact_rows, relative, stances

from poise.dynamics import Partitions, ReducedDynamics

SEEDS = range(3)
TOLERANCE = 1e-9
STEP = 1e-6
ONE_CHAIN = ("double support", "left support", "right support", "hand contact", "flight")


def centroid_jacobian(robot, q, joints):
    """bJ_G,uc of (10): the average velocity of the chain against the base, along the base's axes.

    At the chain's own centre of mass.
    """
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    momentum, inertia = np.zeros((6, len(joints))), pin.Inertia.Zero()
    for i in (joints - 4).tolist():  # joint 2 has coordinate 6
        body = data.oMi[i].act(model.inertias[i])
        J = pin.getJointJacobian(model, data, i, pin.ReferenceFrame.WORLD)[:, joints]
        momentum += body.matrix() @ J
        inertia += body
    world_T_centroid = pin.SE3(data.oMi[1].rotation, inertia.lever)
    momentum = world_T_centroid.inverse().dualAction @ momentum
    return np.linalg.solve(world_T_centroid.actInv(inertia).matrix(), momentum)


class PaperForm:
    """Equations (11) to (16) at one state."""

    def __init__(self, robot, partition, state):
        dynamics = Dynamics(robot)
        dynamics.update(state)
        a, u = partition.a, partition.u
        na, nr = len(a), len(a) + 6
        self.J_r = np.zeros((nr, robot.nv))  # (13)
        self.J_r[np.arange(na), a] = 1.0
        self.J_r[na:, u] = centroid_jacobian(robot, state.q, u)
        q = [moved(robot, state.q, sign * STEP * state.v) for sign in (1, -1)]
        rate = (centroid_jacobian(robot, q[0], u) - centroid_jacobian(robot, q[1], u)) / (2 * STEP)
        self.drift = np.concatenate((np.zeros(na), rate @ state.v[u]))  # Jdot_r v
        inverse = np.linalg.inv(dynamics.M)
        self.M_r = np.linalg.inv(self.J_r @ inverse @ self.J_r.T)  # (14a)
        self.Jbar_transposed = self.M_r @ self.J_r @ inverse  # (14d)
        # (14b) and (14c), the bias with gravity.
        self.h_r = self.Jbar_transposed @ dynamics.h - self.M_r @ self.drift
        self.dynamics = dynamics


@pytest.fixture(params=[(name, stance) for name in HUMANOIDS for stance in ONE_CHAIN])
def case(request, get_robot):
    name, stance = request.param
    robot = get_robot(name)
    frames = stances(robot)[stance]
    return robot, frames, Partitions(robot).of(frames)


def at(case, seed):
    robot, _, partition = case
    state = random_state(robot, seed)
    paper = PaperForm(robot, partition, state)
    reduced = ReducedDynamics(robot, partition)
    reduced.update(paper.dynamics)
    return paper, reduced


def test_mass_matrices_are_the_same_in_other_coordinates(case):
    for seed in SEEDS:
        paper, reduced = at(case, seed)
        na, u = reduced.partition.na, reduced.partition.u
        # z = T v_G, an invertible change of the centroid's coordinates.
        T = np.linalg.lstsq(paper.J_r[na:, u].T, reduced.J_z.T, rcond=None)[0].T
        assert relative(T @ paper.J_r[na:, u], reduced.J_z) < TOLERANCE
        change = np.eye(len(paper.M_r))
        change[na:, na:] = T
        assert relative(change.T @ reduced.M @ change, paper.M_r) < TOLERANCE


def test_equations_of_motion_are_the_same(case):
    robot, frames, partition = case
    for seed in SEEDS:
        paper, reduced = at(case, seed)
        na, a = partition.na, partition.a
        rng = np.random.default_rng(seed)
        dv = 5.0 * rng.normal(size=robot.nv)
        J, _ = contact_rows(robot, paper.dynamics, frames)
        F = 100.0 * rng.normal(size=len(J))
        ddq_r = paper.J_r @ dv + paper.drift  # (12), differentiated
        J_cr = np.zeros((len(J), len(paper.M_r)))
        J_cr[:, :na] = J[:, a]  # (15)
        assert np.abs((paper.Jbar_transposed @ J.T).T - J_cr).max(initial=0.0) < TOLERANCE
        forces = paper.M_r @ ddq_r + paper.h_r - J_cr.T @ F  # (14)
        ours = reduced.forces_a(reduced.reduce(dv)) - J[:, a].T @ F
        assert relative(ours, forces[:na]) < TOLERANCE
        tau = paper.dynamics.M @ dv + paper.dynamics.h - J.T @ F
        assert relative(forces, paper.Jbar_transposed @ tau) < TOLERANCE
