"""The contact of a sole that leans with its leg: on its lower edge, and only what that holds."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import difference_drift, difference_jacobian, dynamics_at, frame_placement
from scipy.optimize import linprog

from poise.dynamics import RobotState
from poise.robots import FULL_TILT
from poise.stack import FrameTask, Stack, StackRows, SurfaceContact

MU, MARGIN = 0.6, 0.01
ROLL = ".*_ankle_roll"
FIVE = [0, 1, 2, 4, 5]


@pytest.fixture
def robot(get_robot_without):
    return get_robot_without(ROLL)


@pytest.fixture
def contact(robot):
    contact = SurfaceContact("left_sole", friction=MU, margin=MARGIN)
    contact.bind(robot)
    return contact


def tilted(robot, roll, seed=0):
    """Home rolled to one side, with a random velocity."""
    q = robot.q_home.copy()
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(roll, 0.0, 0.3)).coeffs()
    return RobotState(q, np.random.default_rng(seed).normal(scale=0.3, size=robot.nv))


@pytest.mark.parametrize("roll", [0.1, -0.1, 0.005, 0.0])
def test_its_rows_are_those_of_the_middle_of_the_lower_edge(robot, contact, roll):
    state = tilted(robot, roll)
    width = robot.soles["left_sole"].width
    side = -np.clip(np.sin(roll) / FULL_TILT, -1.0, 1.0)
    R = frame_placement(robot, state.q, "left_sole").rotation
    edge = np.array([0.0, side * width / 2.0, 0.0])

    def difference(minus, plus):
        a, b = (frame_placement(robot, q, "left_sole") for q in (minus, plus))
        moved = b.act(edge) - a.act(edge)
        return np.concatenate((R.T @ moved, R.T @ pin.log3(b.rotation @ a.rotation.T)))

    def velocity(q, v):
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, q, v)
        sole = robot.frame_id("left_sole")
        twist = pin.getFrameVelocity(robot.model, data, sole, pin.LOCAL_WORLD_ALIGNED).vector
        arm = frame_placement(robot, q, "left_sole").rotation @ edge
        return np.concatenate((twist[:3] + np.cross(twist[3:], arm), twist[3:]))

    contact.evaluate(dynamics_at(robot, state.q, state.v))
    jacobian = difference_jacobian(robot, state.q, difference)[FIVE]
    rate = difference_drift(robot, state, velocity)
    drift = np.concatenate((R.T @ rate[:3], R.T @ rate[3:]))[FIVE]
    assert contact.dim == 5
    assert np.abs(contact.jacobian - jacobian).max() < 1e-7
    assert np.abs(contact.drift - drift).max() < 1e-6
    assert np.abs(contact.reference + contact.damping * jacobian @ state.v).max() < 1e-5


def ends_can_give(half, wrench):
    """Whether forces in the pyramid at the ends of an edge add up to a wrench: a linear program."""
    points = np.array([[half, 0.0, 0.0], [-half, 0.0, 0.0]])
    grasp = np.hstack([np.vstack((np.eye(3), pin.skew(p))) for p in points])
    assert np.abs(grasp[3]).max() == 0.0
    pyramid = np.array([[1.0, 0, -MU], [-1.0, 0, -MU], [0, 1.0, -MU], [0, -1.0, -MU], [0, 0, -1.0]])
    found = linprog(
        np.zeros(6),
        A_ub=np.kron(np.eye(2), pyramid),
        b_ub=np.zeros(10),
        A_eq=grasp[FIVE],
        b_eq=wrench,
        bounds=(None, None),
    )
    return found.status == 0


def test_its_cone_is_exactly_what_forces_at_the_ends_of_the_edge_add_up_to(robot, contact):
    half = robot.soles["left_sole"].length / 2.0 - MARGIN
    rng, inside = np.random.default_rng(0), 0
    for _ in range(300):
        wrench = rng.uniform(-1.0, 1.0, 5) * np.array([MU, MU, 1.0, half, MU * half]) * 0.8
        wrench[2] = 1.0
        worst = (contact.cone @ wrench).max()
        if abs(worst) > 1e-6:
            assert ends_can_give(half, wrench) == (worst < 0.0)
            inside += worst < 0.0
    assert 50 < inside < 250


def test_it_stands_in_for_the_pose_of_its_sole_and_not_for_its_roll(robot, contact):
    pose = FrameTask("left_sole", name="pose")
    roll = FrameTask("left_sole", "orientation_x", name="roll")
    place = FrameTask("left_sole", "position", name="place")
    stack = Stack(contacts=[contact], levels=[[pose, roll, place]])
    stack.bind(robot)
    rows = StackRows(robot, stack, [contact])
    assert rows.suspended == (pose, place)


def test_the_pose_of_its_sole_has_no_row_for_its_roll_about_the_soles_own_axis(robot):
    state = tilted(robot, 0.2)
    task = FrameTask("left_sole")
    task.bind(robot)
    assert task.dim == 5
    dynamics = dynamics_at(robot, state.q, state.v)
    frame = dynamics.frame(robot.frame_id("left_sole"))
    R = frame.rotation
    target = R @ pin.rpy.rpyToMatrix(0.7, 0.0, 0.0)
    task.set_target(frame.position, target)
    task.evaluate(dynamics)
    # Another roll is no error, and another pitch is one about the sole's y.
    assert np.abs(task.error).max() < 1e-12
    task.set_target(frame.position, R @ pin.rpy.rpyToMatrix(0.0, 0.1, 0.0))
    task.evaluate(dynamics)
    np.testing.assert_allclose(task.error, [0.0, 0.0, 0.0, 0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(task.error_rate[3:], -(R.T @ frame.velocity[3:])[1:], atol=1e-12)
    np.testing.assert_allclose(task.jacobian @ state.v, -task.error_rate, atol=1e-12)


def test_a_leg_without_yaw_leaves_the_yaw_of_its_contact_free(get_robot_without):
    contact = SurfaceContact("left_sole")
    contact.bind(get_robot_without(".*_hip_yaw"))
    assert contact.chosen.tolist() == [0, 1, 2, 3, 4]
    assert contact.edge_distance == 0.0
    assert contact.cone.shape == (8, 5)
