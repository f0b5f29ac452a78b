import numpy as np
import pytest

from poise.errors import ConfigurationError, PoiseError, TargetError, UnknownNameError
from poise.stack import ComTask, FrameTask, JointTask, MomentumTask, PostureTask, RelativeFrameTask
from poise.stack._axes import parse_axes

GROUPS = {"position": 0, "orientation": 3}
NAN, INF = float("nan"), float("inf")


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


@pytest.mark.parametrize(
    ("axes", "rows"),
    [
        ("position", [0, 1, 2]),
        ("orientation", [3, 4, 5]),
        ("position_x", [0]),
        ("orientation_zx", [3, 5]),
        ("position+orientation", [0, 1, 2, 3, 4, 5]),
        ("orientation_y + position_z", [2, 4]),
        ("position_x+position_z", [0, 2]),
    ],
)
def test_masks_are_read(axes, rows):
    assert parse_axes(axes, GROUPS).tolist() == rows


@pytest.mark.parametrize(("axes", "rows"), [("xy", [0, 1]), ("z", [2]), ("angular_x", [0])])
def test_a_lone_group_may_be_left_out(axes, rows):
    assert parse_axes(axes, {"angular": 0}).tolist() == rows


@pytest.mark.parametrize(
    "axes",
    ["", " ", "+", "x", "pos", "position_", "position_w", "position_xx", "position+", "_x",
     "position+position_x", "orientation-x", "positionx", "pose_x", "POSITION"],
)  # fmt: skip
def test_masks_that_cannot_be_read_are_refused(axes):
    with pytest.raises(ConfigurationError, match="axis"):
        parse_axes(axes, GROUPS)


@pytest.mark.parametrize("axes", ["", " ", "x+", "linear", "xyzx", "com_x"])
def test_masks_of_a_lone_group_that_cannot_be_read_are_refused(axes):
    with pytest.raises(ConfigurationError, match="axis"):
        ComTask(axes)
    with pytest.raises(ConfigurationError, match="axis"):
        MomentumTask(axes)


@pytest.mark.parametrize("value", [-1.0, NAN, INF, [1.0, -1.0, 1.0], [1.0, NAN, 1.0]])
@pytest.mark.parametrize("gain", ["kp", "kd", "weight"])
def test_gains_that_are_negative_or_not_finite_are_refused(gain, value):
    with pytest.raises(ConfigurationError, match=f"{gain} of task 'com'"):
        ComTask(**{gain: value})


@pytest.mark.parametrize("gain", ["kp", "kd", "weight"])
def test_gains_of_the_wrong_length_are_refused_at_binding(robot, gain):
    with pytest.raises(ConfigurationError, match=f"{gain} of task 'com'.*3 numbers"):
        ComTask(**{gain: [1.0, 2.0]}).bind(robot)


def test_a_momentum_gain_is_called_what_the_user_calls_it(robot):
    with pytest.raises(ConfigurationError, match="kd of task 'angular momentum'"):
        MomentumTask(kd=-1.0)
    with pytest.raises(ConfigurationError, match="kd of task 'angular momentum'"):
        MomentumTask(kd=[1.0, 2.0]).bind(robot)


def test_a_weight_of_zero_is_refused(robot):
    with pytest.raises(ConfigurationError, match="weight of task 'com' is out of range.*> 0"):
        ComTask(weight=0.0).bind(robot)


@pytest.mark.parametrize("value", [[0.0, 0.0], np.zeros((3, 1)), 1.0, [0.0, NAN, 0.0], [INF] * 3])
def test_com_targets_that_cannot_be_right_are_refused(value):
    task = ComTask()
    for targets in ((value,), (np.zeros(3), value), (np.zeros(3), np.zeros(3), value)):
        with pytest.raises(TargetError, match="'com'"):
            task.set_target(*targets)
        assert task.target_position is None


@pytest.mark.parametrize("make", [lambda: FrameTask("f"), lambda: RelativeFrameTask("f", "g")])
@pytest.mark.parametrize(
    "rotation",
    [
        np.eye(2),
        np.zeros((3, 3)),
        2.0 * np.eye(3),
        np.diag([1.0, 1.0, -1.0]),
        np.full((3, 3), NAN),
        np.eye(3) + 1e-3 * np.eye(3, k=1),
        [0.0, 0.0, 0.0, 2.0],
        [0.0, 0.0, 1.0],
    ],
)
def test_targets_that_are_no_rotation_are_refused_and_change_nothing(make, rotation):
    task = make()
    with pytest.raises(TargetError, match="rotation"):
        task.set_target(np.zeros(3), rotation)
    assert task._target.position is None


@pytest.mark.parametrize("velocity", [np.zeros(3), np.full(6, NAN), np.zeros((2, 3))])
def test_pose_rates_have_six_finite_numbers(velocity):
    with pytest.raises(TargetError):
        FrameTask("f").set_target(np.zeros(3), velocity=velocity)
    with pytest.raises(TargetError):
        FrameTask("f").set_target(np.zeros(3), acceleration=velocity)


@pytest.mark.parametrize("position", [np.zeros(2), [NAN, 0.0, 0.0], np.zeros((1, 3))])
def test_pose_positions_have_three_finite_numbers(position):
    with pytest.raises(TargetError):
        FrameTask("f").set_target(position)
    with pytest.raises(TargetError):
        RelativeFrameTask("f", "g").set_target(position)


def test_accelerations_of_the_wrong_shape_are_refused(robot):
    task = ComTask("xy")
    task.bind(robot)
    for bad in ([1.0, 2.0, 3.0], [NAN, 0.0], 1.0):
        with pytest.raises(TargetError, match="acceleration"):
            task.set_acceleration(bad)


def test_an_acceleration_set_before_binding_is_checked_at_binding(robot):
    task = ComTask("xy")
    task.set_acceleration([1.0, 2.0, 3.0])
    with pytest.raises(TargetError, match="acceleration of task 'com'"):
        task.bind(robot)


def test_joint_targets_have_one_finite_number_a_joint(robot):
    task = JointTask(robot.joint_names[:3])
    task.bind(robot)
    for bad in (np.zeros(2), [NAN, 0.0, 0.0], np.zeros((3, 1))):
        with pytest.raises(TargetError):
            task.set_target(bad)


def test_posture_of_the_wrong_length_is_refused(robot):
    with pytest.raises(TargetError, match="'posture'"):
        PostureTask(np.zeros(3)).bind(robot)
    with pytest.raises(TargetError, match="'posture'"):
        PostureTask([NAN] * 33)
    with pytest.raises(TargetError, match="'posture'"):
        PostureTask(0.5)


def test_unknown_names_are_refused_with_choices(robot):
    with pytest.raises(UnknownNameError, match="left_hand") as caught:
        FrameTask("left_hnad").bind(robot)
    assert "left_hand" in caught.value.choices
    with pytest.raises(UnknownNameError, match="choices"):
        RelativeFrameTask("left_hand", "nowhere").bind(robot)
    with pytest.raises(UnknownNameError, match="choices"):
        JointTask(["left_kneee"]).bind(robot)


def test_joints_are_named_once_and_at_least_one():
    with pytest.raises(ConfigurationError, match="twice"):
        JointTask(["a", "b", "a"])
    with pytest.raises(ConfigurationError, match="no joint"):
        JointTask([])


@pytest.mark.parametrize("make", [ComTask, JointTask, PostureTask, MomentumTask])
def test_a_task_serves_one_robot(get_robot, make):
    task = make()
    task.bind(get_robot("humanoid33"))
    with pytest.raises(ConfigurationError, match="already serves another robot"):
        task.bind(get_robot("g1"))


def test_a_task_that_failed_to_bind_can_be_bound_to_the_right_robot(get_robot):
    task = JointTask([get_robot("g1").joint_names[0]])
    with pytest.raises(UnknownNameError):
        task.bind(get_robot("arm6"))
    task.bind(get_robot("g1"))
    assert task.dim == 1


def test_a_task_without_a_robot_says_so():
    task = JointTask()
    for use in (lambda: task.robot, lambda: task.set_target([0.0])):
        with pytest.raises(ConfigurationError, match="serves no robot yet"):
            use()
    task.reset()
    assert task.target_position is None


def test_every_refusal_is_a_poise_error(robot):
    for bad in (lambda: ComTask("q"), lambda: ComTask(kp=-1), lambda: FrameTask("?").bind(robot)):
        with pytest.raises(PoiseError):
            bad()
