"""Jacobian, drift and reference of contacts against differences."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import (
    difference_drift,
    difference_jacobian,
    dynamics_at,
    frame_placement,
    random_state,
)

from poise.dynamics import Dynamics
from poise.stack import PointContact, SurfaceContact

SEEDS = range(4)


@pytest.fixture(params=["humanoid33", "g1"])
def robot(request, get_robot):
    return get_robot(request.param)


def evaluated(contact, robot, state):
    contact.bind(robot)
    contact.evaluate(dynamics_at(robot, state.q, state.v))
    return contact


@pytest.mark.parametrize("seed", SEEDS)
def test_rows_equal_differences_along_the_contacts_own_axes(robot, seed):
    state = random_state(robot, seed)
    R = frame_placement(robot, state.q, "left_sole").rotation

    def difference(minus, plus):
        a, b = (frame_placement(robot, q, "left_sole") for q in (minus, plus))
        turn = pin.log3(b.rotation @ a.rotation.T)
        return np.concatenate((R.T @ (b.translation - a.translation), R.T @ turn))

    jacobian = difference_jacobian(robot, state.q, difference)

    def world_velocity(q, v):
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, q, v)
        frame_id = robot.frame_id("left_sole")
        aligned = pin.LOCAL_WORLD_ALIGNED
        return pin.getFrameVelocity(robot.model, data, frame_id, aligned).vector

    rate = difference_drift(robot, state, world_velocity)
    drift = np.concatenate((R.T @ rate[:3], R.T @ rate[3:]))
    for contact in (SurfaceContact("left_sole"), PointContact("left_sole", name="point")):
        evaluated(contact, robot, state)
        dim = contact.dim
        assert np.abs(contact.jacobian - jacobian[:dim]).max() < 1e-8
        assert np.abs(contact.drift - drift[:dim]).max() < 1e-7 * (1.0 + np.abs(drift).max())
        velocity = jacobian[:dim] @ state.v
        assert np.abs(contact.reference + contact.damping * velocity).max() < 1e-5


def test_a_contact_is_asked_to_move_beside_its_damping(robot):
    state, asked = random_state(robot, 2), np.arange(1.0, 7.0)
    for contact in (SurfaceContact("left_sole"), PointContact("left_sole", name="point")):
        before = evaluated(contact, robot, state).reference.copy()
        contact.set_acceleration(asked[: contact.dim])
        np.testing.assert_array_equal(contact.acceleration, asked[: contact.dim])
        after = evaluated(contact, robot, state).reference
        np.testing.assert_allclose(after - before, asked[: contact.dim], atol=1e-12)
        contact.set_acceleration(np.zeros(contact.dim))
        np.testing.assert_array_equal(evaluated(contact, robot, state).reference, before)


def test_any_frame_may_be_a_surface_if_its_size_is_given(robot):
    contact = SurfaceContact("left_hand", length=0.1, width=0.05)
    contact.bind(robot)
    contact.evaluate(Dynamics(robot))
    assert contact.jacobian.shape == (6, robot.nv)
