"""Jacobians under the stance constraint: against (13) written out, and against integration."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import random_state

from poise.control._differential_ik._rows import base_from_joints, constrained
from poise.dynamics import Dynamics
from poise.stack import SurfaceContact

ROBOTS = ("biped20", "humanoid33", "g1")
FEET = ("left_sole", "right_sole")


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def stance_of(robot, foot):
    contact = SurfaceContact(foot)
    contact.bind(robot)
    return contact


def paper_matrices(robot, q, foot):
    """M_G* / m and H_G* of (13), from the base's world-aligned velocity on.

    Of (13b) the first line: its second reads p_GB + p_LB, which is right only where p_LB is meant
    as the base seen from the foot, and its lower right block lacks nothing.
    """
    model, data = robot.model, robot.model.createData()
    pin.computeCentroidalMap(model, data, q)
    pin.framesForwardKinematics(model, data, q)
    pin.computeJointJacobians(model, data, q)
    R = pin.XYZQUATToSE3(q[:7]).rotation
    A = data.Ag.copy()
    m = pin.computeTotalMass(model)
    M_hat, H_joints = A[:3, 6:] / m, A[3:, 6:]
    H_base = A[3:, 3:6] @ R.T
    p_base, p_foot = q[:3], data.oMf[model.getFrameId(foot)].translation
    p_GB, p_BL = data.com[0] - p_base, p_foot - p_base
    J_foot = pin.getFrameJacobian(model, data, model.getFrameId(foot), pin.LOCAL_WORLD_ALIGNED)[
        :, 6:
    ]
    eye, zero = np.eye(3), np.zeros((3, 3))
    to_com = np.block([[eye, -skew(p_GB)], [zero, H_base]])
    # (9) to (11): the foot's velocity is [I, -[p_BL x]; 0, I] of the base's, plus J_foot u.
    base = -np.block([[eye, skew(p_BL)], [zero, eye]]) @ J_foot
    return to_com @ base + np.vstack((M_hat, H_joints))


@pytest.mark.parametrize("foot", FEET)
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(5))
def test_com_and_momentum_are_those_of_the_paper(get_robot, name, foot, seed):
    robot = get_robot(name)
    state = random_state(robot, seed)
    dynamics = Dynamics(robot)
    dynamics.update(state)
    contact = stance_of(robot, foot)
    contact.evaluate(dynamics)
    X = base_from_joints(contact.jacobian)
    wanted = paper_matrices(robot, state.q, foot)
    com = constrained(dynamics.com_jacobian, X)
    momentum = constrained(dynamics.momentum_matrix, X)
    assert np.abs(com - wanted[:3]).max() < 1e-11
    assert np.abs(momentum[3:] - wanted[3:]).max() < 1e-9
    assert np.abs(momentum[:3] - robot.mass * wanted[:3]).max() < 1e-9


@pytest.mark.parametrize("foot", FEET)
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(5))
def test_the_robot_moves_as_the_constrained_jacobians_say(get_robot, follow, name, foot, seed):
    """Against integration with the base put back by a forward kinematics of its own."""
    robot = get_robot(name)
    state = random_state(robot, seed)
    u = np.random.default_rng(seed + 100).normal(size=robot.nj)
    h = 1e-6
    forth, back = (follow(robot, foot, h, state.q) for _ in range(2))
    forth.move(u)
    back.move(-u)
    dynamics = Dynamics(robot)
    dynamics.update(state)
    contact = stance_of(robot, foot)
    contact.evaluate(dynamics)
    X = base_from_joints(contact.jacobian)
    base = pin.difference(robot.model, back.q, forth.q)[:6] / (2.0 * h)
    assert np.abs(X @ u - base).max() < 1e-7
    com = (forth.com - back.com) / (2.0 * h)
    assert np.abs(constrained(dynamics.com_jacobian, X) @ u - com).max() < 1e-7
    for frame in ("left_hand", "right_sole", "torso"):
        a, b = back.placement(frame), forth.placement(frame)
        moved = np.concatenate(
            (b.translation - a.translation, pin.log3(b.rotation @ a.rotation.T))
        ) / (2.0 * h)
        jacobian = dynamics.frame(robot.frame_id(frame)).jacobian
        assert np.abs(constrained(jacobian, X) @ u - moved).max() < 1e-7


def test_the_stance_foot_itself_has_no_jacobian_left(get_robot):
    robot = get_robot("biped20")
    dynamics = Dynamics(robot)
    dynamics.update(random_state(robot, 3))
    contact = stance_of(robot, "left_sole")
    contact.evaluate(dynamics)
    X = base_from_joints(contact.jacobian)
    jacobian = dynamics.frame(robot.frame_id("left_sole")).jacobian
    assert np.abs(constrained(jacobian, X)).max() < 1e-13
