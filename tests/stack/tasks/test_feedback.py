"""Error signs, references, gains, holding and resetting."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import dynamics_at, frame_placement, moved, random_state
from scipy.spatial.transform import Rotation

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.stack import ComTask, FrameTask, JointTask, MomentumTask, PostureTask, RelativeFrameTask


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


def close_the_loop(robot, task, state, seconds=2.0, dt=2e-3):
    """Integrates J dv = reference - drift; returns norms of the error at the start and the end."""
    q, v = state.q.copy(), state.v.copy()
    dynamics, errors = Dynamics(robot), []
    for _ in range(int(seconds / dt)):
        dynamics.update(RobotState(q, v))
        task.evaluate(dynamics)
        errors.append(float(np.linalg.norm(task.error)))
        dv = np.linalg.pinv(task.jacobian) @ (task.reference - task.drift)
        v = v + dt * dv
        q = moved(robot, q, dt * v)
    return errors[0], errors[-1]


def start(robot):
    """A bent posture at rest, far from singular arms."""
    state = random_state(robot, 5, speed=0.0)
    return RobotState(state.q, state.v)


def make_goal(robot, task, state):
    """Sets a target some way off the current state."""
    q = moved(robot, state.q, 0.1 * np.random.default_rng(7).normal(size=robot.nv))
    if isinstance(task, FrameTask):
        goal = frame_placement(robot, q, task.frame)
        task.set_target(goal.translation, goal.rotation)
    elif isinstance(task, RelativeFrameTask):
        root = frame_placement(robot, q, task.root)
        goal = root.actInv(frame_placement(robot, q, task.frame))
        task.set_target(goal.translation, goal.rotation)
    elif isinstance(task, ComTask):
        task.set_target(pin.centerOfMass(robot.model, robot.model.createData(), q))
    elif isinstance(task, JointTask):
        task.set_target(q[robot.nq - robot.nj :])
    else:
        task.set_target([1.0, -0.5, 0.3])


@pytest.mark.parametrize(
    "make",
    [
        lambda: FrameTask("left_hand"),
        lambda: FrameTask("left_hand", "position"),
        lambda: FrameTask("left_hand", "orientation"),
        lambda: RelativeFrameTask("left_hand", "torso"),
        lambda: RelativeFrameTask("left_hand", "right_hand", "orientation"),
        ComTask,
        JointTask,
        PostureTask,
        MomentumTask,
    ],
)
def test_positive_gains_drive_the_error_to_zero(robot, make):
    task, state = make(), start(robot)
    task.bind(robot)
    make_goal(robot, task, state)
    before, after = close_the_loop(robot, task, state)
    assert before > 0.02
    assert after < 2e-3 * before


@pytest.mark.parametrize("beyond", [-1e-3, 1e-3])
def test_nearly_half_a_turn_away_is_driven_to_zero_too(robot, beyond):
    task, state = FrameTask("pelvis", "orientation", speed=np.pi), start(robot)
    task.bind(robot)
    at = frame_placement(robot, state.q, "pelvis").rotation
    task.set_target(rotation=Rotation.from_rotvec([np.pi + beyond, 0.0, 0.0]).as_matrix() @ at)
    before, after = close_the_loop(robot, task, state, seconds=3.0)
    assert before == pytest.approx(np.pi - 1e-3, abs=1e-6)
    assert after < 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_error_rate_is_the_rate_of_the_error(robot, seed):
    """Along v, with a moving target; for orientations to first order in the error."""
    state = random_state(robot, seed)
    target_velocity = np.random.default_rng(seed).normal(size=6)
    at = frame_placement(robot, state.q, "left_hand")

    def error(t):
        task = FrameTask("left_hand")
        task.bind(robot)
        turned = Rotation.from_rotvec(t * target_velocity[3:]).as_matrix() @ at.rotation
        task.set_target(at.translation + t * target_velocity[:3], turned, velocity=target_velocity)
        task.evaluate(dynamics_at(robot, moved(robot, state.q, t * state.v), state.v))
        return task.error, task.error_rate

    h = 1e-6
    rate = (error(h)[0] - error(-h)[0]) / (2.0 * h)
    assert np.abs(rate - error(0.0)[1]).max() < 1e-6


def test_reference_is_feedforward_plus_gains_times_errors(robot):
    state = random_state(robot, 1)
    rng = np.random.default_rng(1)
    kp, kd = rng.uniform(1.0, 100.0, 6), rng.uniform(1.0, 20.0, 6)
    velocity, acceleration = rng.normal(size=6), rng.normal(size=6)
    task = FrameTask("left_hand", kp=kp, kd=kd, speed=np.inf)
    task.bind(robot)
    target = rng.normal(size=3), Rotation.random(rng=rng).as_matrix()
    task.set_target(*target, velocity=velocity, acceleration=acceleration)
    dynamics = dynamics_at(robot, state.q, state.v)
    task.evaluate(dynamics)
    frame = dynamics.frame(robot.frame_id("left_hand"))
    turn = Rotation.from_matrix(target[0:2][1] @ frame.rotation.T).as_rotvec()
    error = np.concatenate((target[0] - frame.position, turn))
    expected = acceleration + kp * error + kd * (velocity - frame.velocity)
    assert np.abs(task.error - error).max() < 1e-12
    assert np.abs(task.reference - expected).max() < 1e-9


def test_joint_rates_and_accelerations_enter_the_reference(robot):
    task = JointTask(robot.joint_names[:2], kp=4.0, kd=1.0)
    task.bind(robot)
    task.set_target([0.1, 0.2], [0.3, 0.4], [0.5, 0.6])
    state = random_state(robot, 1)
    task.evaluate(dynamics_at(robot, state.q, state.v))
    error = np.array([0.1, 0.2]) - state.q[7:9]
    rate = np.array([0.3, 0.4]) - state.v[6:8]
    assert np.abs(task.reference - (np.array([0.5, 0.6]) + 4.0 * error + rate)).max() < 1e-12


def test_com_rates_and_accelerations_are_masked_with_the_position(robot):
    task = ComTask("xz", kp=4.0, kd=1.0, speed=np.inf)
    task.bind(robot)
    task.set_target([1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0])
    state = random_state(robot, 1)
    dynamics = dynamics_at(robot, state.q, state.v)
    task.evaluate(dynamics)
    full = np.array([7.0, 8.0, 9.0]) + 4.0 * (np.array([1.0, 2.0, 3.0]) - dynamics.com)
    full += np.array([4.0, 5.0, 6.0]) - dynamics.com_velocity
    assert np.abs(task.reference - full[[0, 2]]).max() < 1e-12
    shown = task.masked_target()
    assert np.array_equal(shown[[0, 2]], [1.0, 3.0])
    assert np.isnan(shown[1])


def holding(robot):
    return [
        FrameTask("left_hand"),
        FrameTask("left_hand", "position", name="p"),
        FrameTask("left_hand", "orientation", name="o"),
        RelativeFrameTask("left_hand", "torso"),
        ComTask(),
        JointTask(),
    ]


@pytest.mark.parametrize("index", range(6))
def test_a_task_without_a_target_holds_what_it_saw_first_until_reset(robot, index):
    task = holding(robot)[index]
    task.bind(robot)
    first, second = random_state(robot, 1, 0.0), random_state(robot, 2, 0.0)
    dynamics = Dynamics(robot)  # one object, as in a controller: views into it must not be kept
    dynamics.update(first)
    task.evaluate(dynamics)
    assert np.abs(task.error).max() < 1e-12
    dynamics.update(second)
    task.evaluate(dynamics)
    assert np.abs(task.error).max() > 0.05
    dynamics.update(first)
    task.evaluate(dynamics)
    assert np.abs(task.error).max() < 1e-12
    task.reset()
    dynamics.update(second)
    task.evaluate(dynamics)
    assert np.abs(task.error).max() < 1e-12


@pytest.mark.parametrize("index", range(6))
def test_reset_keeps_a_target_that_a_user_set(robot, index):
    task = holding(robot)[index]
    task.bind(robot)
    state = random_state(robot, 1, 0.0)
    make_goal(robot, task, state)
    dynamics = dynamics_at(robot, state.q, state.v)
    task.evaluate(dynamics)
    before = task.error.copy()
    task.reset()
    task.evaluate(dynamics)
    assert np.abs(before).max() > 0.01
    assert np.array_equal(task.error, before)


@pytest.mark.parametrize("index", range(6))
def test_a_target_that_a_leader_overwrites_is_as_if_it_had_been_set(robot, index):
    ours, other = (holding(robot)[index] for _ in range(2))
    state = random_state(robot, 1, 0.0)
    dynamics = dynamics_at(robot, state.q, state.v)
    for task in (ours, other):
        task.bind(robot)
    ours.evaluate(dynamics)  # holds what it sees
    make_goal(robot, other, state)
    ours.overwrite_target()[:] = other.overwrite_target()
    ours.reset()
    for task in (ours, other):
        task.evaluate(dynamics)
    assert np.abs(ours.error).max() > 0.01
    np.testing.assert_array_equal(ours.error, other.error)
    np.testing.assert_array_equal(ours.reference, other.reference)


def test_what_a_pose_target_does_not_give_is_held(robot):
    task = FrameTask("left_hand")
    task.bind(robot)
    first = random_state(robot, 1, 0.0)
    at = frame_placement(robot, first.q, "left_hand")
    task.set_target(position=at.translation + [0.1, 0.0, 0.0])
    task.evaluate(dynamics_at(robot, first.q, first.v))
    assert np.abs(task.error - [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]).max() < 1e-12
    task.set_target(rotation=Rotation.from_rotvec([0.0, 0.2, 0.0]).as_matrix() @ at.rotation)
    task.evaluate(dynamics_at(robot, first.q, first.v))
    assert np.abs(task.error - [0.1, 0.0, 0.0, 0.0, 0.2, 0.0]).max() < 1e-9
    assert np.abs(task.target_position - at.translation - [0.1, 0.0, 0.0]).max() < 1e-12
    assert task.target_rotation.shape == (3, 3)


def test_rates_stay_with_the_part_of_the_pose_they_were_given_for(robot):
    state = random_state(robot, 1, 0.0)
    dynamics = dynamics_at(robot, state.q, state.v)
    task = FrameTask("left_hand")
    task.bind(robot)
    task.set_target(np.zeros(3), np.eye(3), velocity=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    task.set_target(np.zeros(3))
    task.evaluate(dynamics)
    assert np.abs(task.error_rate - [0.0, 0.0, 0.0, 4.0, 5.0, 6.0]).max() < 1e-12
    task.set_target(rotation=np.eye(3))
    task.evaluate(dynamics)
    assert np.abs(task.error_rate).max() < 1e-12
    # Given alone they are those of the whole pose.
    task.set_target(velocity=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    task.evaluate(dynamics)
    np.testing.assert_allclose(task.error_rate, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], atol=1e-12)


def test_a_target_is_copied_from_what_the_user_holds(robot):
    goal, accelerate = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    task = ComTask()
    task.bind(robot)
    task.set_target(goal)
    task.set_acceleration(accelerate)
    goal[:] = 9.0
    accelerate[:] = 9.0
    task.evaluate(Dynamics(robot))
    assert np.array_equal(task.target_position, [0.1, 0.2, 0.3])
    assert np.array_equal(task.reference, [1.0, 2.0, 3.0])


def test_weights_that_were_given_one_a_row_are_copied_and_can_be_set_anew(robot):
    given = np.array([1.0, 2.0, 3.0])
    task = ComTask(weight=given)
    task.bind(robot)
    for weight in (5.0, [4.0, 5.0, 6.0], (7.0, 8.0, 9.0)):
        task.set_weight(weight)
        np.testing.assert_array_equal(task.weight, weight)
    np.testing.assert_array_equal(given, [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    "bad",
    [(1.0, 2.0), (1.0, 2.0, 3.0, 4.0), (1.0, 0.0, 2.0), (1.0, np.inf, 2.0), (1.0, np.nan, 2.0),
     (np.ones(2), 2.0, 3.0), tuple(np.ones((3, 3)))],
)  # fmt: skip
def test_a_row_of_weights_that_cannot_be_is_refused_and_changes_nothing(robot, bad):
    task = ComTask(weight=(3.0, 2.0, 1.0))
    task.bind(robot)
    task.set_weight((1.0, 2.0, 3.0))
    with pytest.raises(ConfigurationError, match="weight of task 'com'"):
        task.set_weight(bad)
    np.testing.assert_array_equal(task.weight, [1.0, 2.0, 3.0])


def test_errors_carry_their_unit(robot):
    units = {t.name: t.unit for t in holding(robot)}
    assert units["left_hand pose"] == "m, rad"
    assert units["p"] == "m"
    assert units["o"] == "rad"
    assert units["com"] == "m"
    assert units["joints"] == "rad"
    assert MomentumTask().unit == "kg m^2/s"
    assert FrameTask("f", "position_x+orientation_z").unit == "m, rad"


def test_binding_twice_to_the_same_robot_keeps_the_target(robot):
    task = JointTask()
    task.bind(robot)
    task.set_target(np.zeros(robot.nj))
    task.bind(robot)
    assert np.array_equal(task.target_position, np.zeros(robot.nj))
    assert task.robot is robot
