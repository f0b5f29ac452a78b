"""Every task's rows against differences of the quantity that the task is about."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import (
    difference_drift,
    difference_jacobian,
    dynamics_at,
    frame_placement,
    moved,
    random_state,
)

from poise.stack import ComTask, FrameTask, JointTask, MomentumTask, PostureTask, RelativeFrameTask

SEEDS = range(4)
ROBOTS = ("humanoid33", "g1", "upper17")
ALL = {"position": [0, 1, 2], "orientation": [3, 4, 5], "pose": list(range(6))}
MASKS = {
    **ALL,
    "position_z": [2],
    "orientation_xy": [3, 4],
    "position_xz+orientation_z": [0, 2, 5],
    "position_zx": [0, 2],
    "orientation+position_y": [1, 3, 4, 5],
}


@pytest.fixture(params=ROBOTS)
def robot(request, get_robot):
    return get_robot(request.param)


def frame_difference(robot, frame, root=None):
    """Difference of a pose between two configurations, in the world or as `root` sees it."""

    def placement(q):
        at = frame_placement(robot, q, frame)
        return at if root is None else frame_placement(robot, q, root).actInv(at)

    def difference(minus, plus):
        a, b = placement(minus), placement(plus)
        return np.concatenate((b.translation - a.translation, pin.log3(b.rotation @ a.rotation.T)))

    return difference


def velocity_by_differences(robot, difference, h=1e-5):
    """Velocity of a pose along `v`, by differences alone: nothing of the task is used."""

    def velocity(q, v):
        return difference(moved(robot, q, -h * v), moved(robot, q, h * v)) / (2.0 * h)

    return velocity


def second_difference(robot, state, difference, h=1e-4):
    """Rate of `velocity_by_differences` along constant v; good to some 1e-6."""
    velocity = velocity_by_differences(robot, difference)
    q, v = state.q, state.v
    plus, minus = moved(robot, q, h * v), moved(robot, q, -h * v)
    return (velocity(plus, v) - velocity(minus, v)) / (2.0 * h)


def evaluated(task, robot, state):
    task.bind(robot)
    dynamics = dynamics_at(robot, state.q, state.v)
    task.evaluate(dynamics)
    return dynamics


@pytest.mark.parametrize("seed", SEEDS)
def test_frame_task_rows_equal_differences_for_every_mask(robot, seed):
    state, name = random_state(robot, seed), robot.hands[0]
    difference = frame_difference(robot, name)
    jacobian = difference_jacobian(robot, state.q, difference)
    drift = second_difference(robot, state, difference)
    for mask, rows in MASKS.items():
        task = FrameTask(name, mask)
        evaluated(task, robot, state)
        assert task.dim == len(rows)
        assert np.abs(task.jacobian - jacobian[rows]).max() < 1e-8
        assert np.abs(task.drift - drift[rows]).max() < 1e-4
        # Holding where it is: no error, and the rate of the error is minus its velocity.
        assert np.abs(task.error).max() < 1e-12
        assert np.abs(task.error_rate + task.jacobian @ state.v).max() < 1e-10


@pytest.mark.parametrize("seed", SEEDS)
def test_relative_frame_task_rows_equal_differences_for_every_mask(robot, seed):
    state, name, root = random_state(robot, seed), robot.hands[0], robot.torso
    difference = frame_difference(robot, name, root)
    jacobian = difference_jacobian(robot, state.q, difference)
    drift = second_difference(robot, state, difference)
    for mask, rows in MASKS.items():
        task = RelativeFrameTask(name, root, mask)
        evaluated(task, robot, state)
        assert np.abs(task.jacobian - jacobian[rows]).max() < 1e-8
        assert np.abs(task.drift - drift[rows]).max() < 1e-4
        assert np.abs(task.error).max() < 1e-12
        assert np.abs(task.error_rate + task.jacobian @ state.v).max() < 1e-10


@pytest.mark.parametrize("seed", SEEDS)
def test_com_task_rows_equal_differences(robot, seed):
    state = random_state(robot, seed)

    def com(q):
        return pin.centerOfMass(robot.model, robot.model.createData(), q)

    def difference(minus, plus):
        return com(plus) - com(minus)

    jacobian = difference_jacobian(robot, state.q, difference)
    drift = second_difference(robot, state, difference)
    for mask, rows in {"position": [0, 1, 2], "xy": [0, 1], "z": [2], "position_y": [1]}.items():
        task = ComTask(mask)
        evaluated(task, robot, state)
        assert np.abs(task.jacobian - jacobian[rows]).max() < 1e-8
        assert np.abs(task.drift - drift[rows]).max() < 1e-4


@pytest.mark.parametrize("seed", SEEDS)
def test_momentum_task_rows_equal_momentum_and_its_rate(robot, seed):
    state = random_state(robot, seed)

    def momentum(q, v):
        data = robot.model.createData()
        return pin.computeCentroidalMomentum(robot.model, data, q, v).angular.copy()

    drift, actual = difference_drift(robot, state, momentum), momentum(state.q, state.v)
    for mask, rows in {"angular": [0, 1, 2], "angular_xy": [0, 1], "z": [2]}.items():
        task = MomentumTask(mask)
        evaluated(task, robot, state)
        assert np.abs(task.jacobian @ state.v - actual[rows]).max() < 1e-9
        assert np.abs(task.drift - drift[rows]).max() < 1e-7 * (1.0 + np.abs(drift).max())
        assert np.abs(task.error + actual[rows]).max() < 1e-9  # towards zero by default
        assert np.array_equal(task.error_rate, task.error)
        assert np.abs(task.reference + 5.0 * actual[rows]).max() < 1e-8


@pytest.mark.parametrize("seed", SEEDS)
def test_joint_task_rows_select_the_named_joints(robot, seed):
    state = random_state(robot, seed)
    names = list(np.random.default_rng(seed).permutation(robot.joint_names)[:5])
    task = JointTask(names)
    evaluated(task, robot, state)
    for row, name in enumerate(names):
        joint = robot.model.joints[robot.model.getJointId(str(name))]
        column = np.zeros(robot.nv)
        column[joint.idx_v] = 1.0
        assert np.array_equal(task.jacobian[row], column)
        assert task.target_position[row] == state.q[joint.idx_q]
        assert task.error_rate[row] == -state.v[joint.idx_v]
    assert np.array_equal(task.drift, np.zeros(5))


def test_posture_task_wants_the_home_posture_of_every_joint_or_one_of_its_own(robot):
    state, own, first = random_state(robot, 0), 0.5 * (robot.q_min + robot.q_max), -robot.nj
    for task, posture in ((PostureTask(), robot.q_home[first:]), (PostureTask(own), own)):
        evaluated(task, robot, state)
        assert task.dim == robot.nj
        assert np.abs(task.error - (posture - state.q[first:])).max() < 1e-15
