"""Derivatives of matrices against finite differences along the motion."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.bias.rows import MatrixRates, contact_jacobian_rate, task_jacobian_rate
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.stack import (
    ComTask,
    FrameTask,
    JointTask,
    MomentumTask,
    PointContact,
    SurfaceContact,
)

_STEP = 1e-6


def _state(robot: Robot, seed: int) -> RobotState:
    rng = np.random.default_rng(seed)
    q = pin.integrate(robot.model, robot.q_home, 0.3 * rng.standard_normal(robot.nv))
    return RobotState(q, rng.standard_normal(robot.nv))


def _along(robot: Robot, state: RobotState, read: Callable[[Dynamics], np.ndarray]) -> np.ndarray:
    """Central difference of a matrix along the motion."""
    dynamics, values = Dynamics(robot), []
    for step in (_STEP, -_STEP):
        q = pin.integrate(robot.model, state.q, step * state.v)
        dynamics.update(RobotState(q, state.v))
        values.append(read(dynamics).copy())
    return (values[0] - values[1]) / (2.0 * _STEP)


@pytest.mark.parametrize("name", ["humanoid33", "arm6", "upper17"])
def test_mass_matrix_rate_is_its_derivative(get_robot: Callable[[str], Robot], name: str) -> None:
    robot = get_robot(name)
    state = _state(robot, 0)
    rates = MatrixRates(robot)
    rates.update(state)
    expected = _along(robot, state, lambda d: d.M)
    np.testing.assert_allclose(rates.mass_matrix, expected, atol=1e-6)


@pytest.mark.parametrize(
    "make",
    [
        lambda: FrameTask("left_hand", "position_xz+orientation_y"),
        ComTask,
        MomentumTask,
        lambda: JointTask(["left_knee"]),
    ],
)
def test_jacobian_rate_of_a_task_is_its_derivative(
    get_robot: Callable[[str], Robot],
    make: Callable[[], FrameTask | ComTask | MomentumTask | JointTask],
) -> None:
    robot = get_robot("humanoid33")
    task = make()
    task.bind(robot)

    def jacobian(dynamics: Dynamics) -> np.ndarray:
        task.evaluate(dynamics)
        return task.jacobian

    state = _state(robot, 1)
    expected = _along(robot, state, jacobian)
    dynamics, rates = Dynamics(robot), MatrixRates(robot)
    dynamics.update(state)
    rates.update(state)
    task.evaluate(dynamics)
    rate = task_jacobian_rate(task, rates)
    np.testing.assert_allclose(rate, expected, atol=2e-6)
    # And it agrees with the drift that the controllers use.
    np.testing.assert_allclose(rate @ state.v, task.drift, atol=1e-9)
    assert sum(task.blocks) == task.dim


@pytest.mark.parametrize("kind", [SurfaceContact, PointContact])
def test_jacobian_rate_of_a_contact_is_its_derivative(
    get_robot: Callable[[str], Robot], kind: type[SurfaceContact] | type[PointContact]
) -> None:
    robot = get_robot("humanoid33")
    contact = kind("left_sole")
    contact.bind(robot)

    state = _state(robot, 2)
    dynamics, rates = Dynamics(robot), MatrixRates(robot)
    dynamics.update(state)
    rates.update(state)
    contact.evaluate(dynamics)
    rate = contact_jacobian_rate(contact, dynamics, rates)
    # A contact's axes stay as they are, so the derivative is that along the world's axes, turned.
    frame_id = robot.frame_id("left_sole")
    R = dynamics.frame(frame_id).rotation.T
    expected = _along(robot, state, lambda d: d.frame(frame_id).jacobian)
    turned = np.concatenate((R @ expected[:3], R @ expected[3:]))[: contact.dim]
    np.testing.assert_allclose(rate, turned, atol=2e-6)
    np.testing.assert_allclose(rate @ state.v, contact.drift, atol=1e-9)
