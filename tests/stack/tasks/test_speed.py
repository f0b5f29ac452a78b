"""Bounded feedback: the velocity that a task asks for, and orientations through half a turn."""

import math

import numpy as np
import pytest
from oracles import dynamics_at, frame_placement, random_state
from scipy.spatial.transform import Rotation

from poise.errors import ConfigurationError
from poise.stack import (
    ComTask,
    FrameTask,
    JointTask,
    MomentumTask,
    PostureTask,
    RelativeFrameTask,
    Stack,
    StackRows,
    Task,
)


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


class OwnCom(Task):
    """The CoM, written in Python."""

    def __init__(self, **settings):
        super().__init__("own", **{"kp": 40.0, "kd": None, "weight": 1.0, **settings})

    def _resolve(self, robot):
        return 3

    def _evaluate(self, dynamics):
        self.jacobian, self.drift = dynamics.com_jacobian.copy(), dynamics.com_bias.copy()
        self.error = self.target - dynamics.com
        self.error_rate = self.target_velocity - dynamics.com_jacobian @ dynamics.v
        return np.array([0.1, 0.2, 0.3])


def expected(task, dynamics, error, target_velocity, feedforward):
    """The formula of `Task`, block by block."""
    actual = task.jacobian @ dynamics.v
    kp, kd, asked = task.kp, task.kd, target_velocity.copy()
    fed_back = (kp > 0.0) & (kd > 0.0)
    asked[fed_back] += (kp / np.where(kd > 0.0, kd, 1.0) * error)[fed_back]
    begin = 0
    for size, speed in zip(task.blocks, task.speed, strict=True):
        rows = np.arange(begin, begin + size)[fed_back[begin : begin + size]]
        most = max(speed, np.linalg.norm(target_velocity[rows]))
        norm = np.linalg.norm(asked[rows])
        if norm > most:
            asked[rows] *= most / norm
        begin += size
    plain = kp * error + kd * (target_velocity - actual)
    return np.where(fed_back, kd * (asked - actual), plain) + feedforward, asked


@pytest.mark.parametrize("distance", [0.01, 0.3, 3.0, 1e6])
@pytest.mark.parametrize("seed", range(3))
def test_frame_feedback_is_the_formula_block_by_block(robot, seed, distance):
    rng = np.random.default_rng(seed)
    kp, kd = rng.uniform(20.0, 100.0, 6), rng.uniform(5.0, 20.0, 6)
    kp[1], kd[4] = 0.0, 0.0
    velocity, acceleration = rng.normal(size=6), rng.normal(size=6)
    state = random_state(robot, seed)
    at, way = frame_placement(robot, state.q, "left_hand"), rng.normal(size=3)
    turn = Rotation.from_rotvec(2.0 * way / np.linalg.norm(way)).as_matrix()
    task = FrameTask("left_hand", kp=kp, kd=kd, speed=(0.7, 1.5))
    task.bind(robot)
    place = at.translation + distance * way
    task.set_target(place, turn @ at.rotation, velocity, acceleration)
    dynamics = dynamics_at(robot, state.q, state.v)
    task.evaluate(dynamics)
    reference, _ = expected(task, dynamics, task.error, velocity, acceleration)
    assert task.reference == pytest.approx(reference, rel=1e-9, abs=1e-9)
    # The error is reported unsaturated.
    assert task.error[:3] == pytest.approx(distance * way, rel=1e-9)


@pytest.mark.parametrize("distance", [0.01, 1.0, 1e6])
def test_compiled_and_own_tasks_bound_alike(robot, distance):
    state, way = random_state(robot, 4), np.array([0.6, -0.3, 1.0])
    dynamics = dynamics_at(robot, state.q, state.v)
    target, velocity = dynamics.com + distance * way, np.array([0.2, 0.1, -0.4])
    com, own = ComTask(speed=0.5), OwnCom(speed=0.5)
    own.target, own.target_velocity = target, velocity
    for task in (com, own):
        task.bind(robot)
    com.set_target(target, velocity, np.array([0.1, 0.2, 0.3]))
    com.evaluate(dynamics)
    own.evaluate(dynamics)
    assert own.error.tolist() == com.error.tolist()
    assert own.reference == pytest.approx(com.reference, rel=1e-9)
    reference, asked = expected(com, dynamics, com.error, velocity, [0.1, 0.2, 0.3])
    assert com.reference == pytest.approx(reference, rel=1e-9)
    stack = Stack(levels=[[com], [own]])
    stack.bind(robot)
    rows = StackRows(robot, stack, ())
    rows.update_velocities(dynamics)
    assert rows.target[:3] == pytest.approx(asked, rel=1e-9)
    assert rows.target[3:] == pytest.approx(asked, rel=1e-9)


def test_shipped_tasks_in_python_bound_as_compiled_ones_do(robot):
    class Mine(FrameTask):
        def _evaluate(self, dynamics):
            return super()._evaluate(dynamics)

    state = random_state(robot, 6)
    dynamics = dynamics_at(robot, state.q, state.v)
    at = frame_placement(robot, state.q, "left_hand")
    found = []
    for kind in (FrameTask, Mine):
        task = kind("left_hand", "position+orientation_xz")
        stack = Stack(levels=[[task]])
        stack.bind(robot)
        turn = Rotation.from_rotvec([1.0, 2.2, 1.8]).as_matrix()
        task.set_target(at.translation + [0.0, 4.0, 3.0], turn @ at.rotation)
        rows = StackRows(robot, stack, ())
        rows.update(dynamics)
        found.append(rows.target.copy())
    assert found[1] == pytest.approx(found[0], rel=1e-9)


def test_what_a_far_target_asks_for_does_not_grow_with_its_distance(robot):
    """At rest: kd times the speed, in the direction of the target."""
    state = random_state(robot, 2, speed=0.0)
    dynamics = dynamics_at(robot, state.q, state.v)
    at = frame_placement(robot, state.q, "left_hand").translation
    task = FrameTask("left_hand", "position", kp=(100.0, 25.0, 49.0), kd=(20.0, 10.0, 14.0))
    task.bind(robot)
    for distance in (1.0, 30.0, 1e6, 1e300):
        task.set_target(at + distance * np.array([1.0, 2.0, -1.0]))
        task.evaluate(dynamics)
        velocity = task.reference / task.kd
        assert np.linalg.norm(velocity) == pytest.approx(2.5)
        way = task.kp / task.kd * [1.0, 2.0, -1.0]
        assert velocity == pytest.approx(2.5 * way / np.linalg.norm(way))


def test_what_was_given_in_place_of_feedback_is_not_bounded(robot):
    state = random_state(robot, 3)
    dynamics = dynamics_at(robot, state.q, state.v)
    task = FrameTask("left_hand", "position", speed=0.1)
    task.bind(robot)
    task.set_target([9.0, 0.0, 0.0])
    task.set_acceleration([500.0, 0.0, 0.0])
    task.evaluate(dynamics)
    assert task.reference.tolist() == [500.0, 0.0, 0.0]


def test_joints_are_bounded_each_by_itself(robot):
    state = random_state(robot, 1, speed=0.0)
    task = JointTask(["left_knee", "left_elbow"], speed=(1.0, 2.0))
    task.bind(robot)
    dynamics = dynamics_at(robot, state.q, state.v)
    angles = [state.q[7 + robot.joint_index(name)] for name in ("left_knee", "left_elbow")]
    task.set_target([angles[0] + 5.0, angles[1] + 0.1])
    task.evaluate(dynamics)
    assert task.reference == pytest.approx([task.kd[0], 5.0])


def frames(robot, axes, turn):
    """A frame and a relative frame task whose targets are turned."""
    state = random_state(robot, 8, speed=0.0)
    hand, root = (frame_placement(robot, state.q, name) for name in ("left_hand", "torso"))
    frame = FrameTask("left_hand", axes)
    relative = RelativeFrameTask("left_hand", "torso", axes)
    targets = turn @ hand.rotation, turn @ root.rotation.T @ hand.rotation
    for task, target in zip((frame, relative), targets, strict=True):
        task.bind(robot)
        task.set_target(rotation=target)
    return dynamics_at(robot, state.q, state.v), (frame, relative)


@pytest.mark.parametrize("axes", ["orientation", "orientation_z", "pose"])
@pytest.mark.parametrize("seed", range(2))
def test_orientation_feedback_is_continuous_through_half_a_turn(robot, seed, axes):
    axis = np.random.default_rng(seed).normal(size=3)
    axis /= np.linalg.norm(axis)
    step, last, errors = 1e-2, None, []
    # The velocity asked for changes by kd a radian at most, the reference by kd times that.
    for angle in np.arange(2.0, 4.5, step):
        dynamics, tasks = frames(robot, axes, Rotation.from_rotvec(angle * axis).as_matrix())
        for task in tasks:
            task.evaluate(dynamics)
        found = np.array([task.reference for task in tasks])
        errors.append([task.error.copy() for task in tasks])
        if last is not None:
            kd = tasks[0].kd[0]
            assert np.abs(found - last).max() < 1.01 * kd * kd * step
        last = found
    # `error` itself turns round there, as rotation vectors do.
    assert np.abs(np.diff(errors, axis=0)).max() > 0.1


@pytest.mark.parametrize("angle", [0.5, 2.0, 2.6, 3.0, math.pi])
def test_orientation_feedback_fades_near_half_a_turn(robot, angle):
    axis = np.array([0.6, 0.0, 0.8])
    dynamics, tasks = frames(robot, "orientation", Rotation.from_rotvec(angle * axis).as_matrix())
    for task in tasks:
        task.set_speed(math.inf)
        task.evaluate(dynamics)
        fed_back = min(angle, 4.0 * (math.pi - angle))
        assert task.reference == pytest.approx(100.0 * fed_back * axis, abs=1e-5)
        assert np.linalg.norm(task.error) == pytest.approx(angle, abs=1e-6)


def test_usual_speeds(robot):
    usual = [
        (ComTask(), [0.35]),
        (FrameTask("left_hand"), [2.5, math.pi]),
        (FrameTask("left_hand", "orientation_z"), [math.pi]),
        (FrameTask("pelvis"), [2.5, 0.8]),
        (FrameTask("torso", "orientation"), [0.8]),
        (RelativeFrameTask("left_hand", "torso"), [2.5, math.pi]),
        (MomentumTask(), [math.inf]),
        (PostureTask(), robot.v_max.tolist()),
        (JointTask(["left_knee"]), [robot.v_max[robot.joint_index("left_knee")]]),
        (OwnCom(), [math.inf]),
    ]
    for task, speeds in usual:
        task.bind(robot)
        assert task.speed.tolist() == speeds


def test_a_speed_counts_from_the_next_tick(robot):
    early, late = FrameTask("left_hand", speed=9.0), FrameTask("left_hand")
    early.set_speed((0.5, 1.0))
    for task in (early, late):
        task.bind(robot)
    late.set_speed((0.5, 1.0))
    assert early.speed.tolist() == late.speed.tolist() == [0.5, 1.0]
    speed = np.array([0.3, 0.4])
    late.set_speed(speed)
    speed[:] = np.nan
    late.speed[:] = 7.0
    assert late.speed.tolist() == [0.3, 0.4]


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.nan, "fast", [1.0, 2.0, 3.0], [1.0, -2.0]])
def test_wrong_speeds_are_refused(robot, wrong):
    bound = FrameTask("left_hand", name="hand")
    bound.bind(robot)
    with pytest.raises(ConfigurationError, match="largest speed of task 'hand'.*got"):
        bound.set_speed(wrong)
    assert bound.speed.tolist() == [2.5, math.pi]
    with pytest.raises(ConfigurationError, match="largest speed of task 'hand'.*got"):
        FrameTask("left_hand", name="hand", speed=wrong).bind(robot)
