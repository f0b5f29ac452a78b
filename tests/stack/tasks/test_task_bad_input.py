import numpy as np
import pytest

from poise.errors import ConfigurationError, TargetError, UnknownNameError
from poise.stack import ComTask, FrameTask, JointTask, MomentumTask, PostureTask, RelativeFrameTask

NAN, INF = float("nan"), float("inf")


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


@pytest.mark.parametrize(
    "axes",
    ["", "+", "x", "position_", "position_w", "position_xx", "position+position_x", "POSITION"],
)
def test_masks_that_cannot_be_read_are_refused(axes):
    with pytest.raises(ConfigurationError, match="axis"):
        FrameTask("left_hand", axes)


@pytest.mark.parametrize("make", [ComTask, MomentumTask])
@pytest.mark.parametrize("axes", ["", "x+", "linear", "xyzx", "com_x"])
def test_masks_of_a_lone_group_that_cannot_be_read_are_refused(make, axes):
    with pytest.raises(ConfigurationError, match="axis"):
        make(axes)


@pytest.mark.parametrize("gain", ["kp", "kd", "weight"])
def test_gains_of_the_wrong_length_are_refused_at_binding(robot, gain):
    with pytest.raises(ConfigurationError, match=f"{gain} of task 'com'.*3 numbers"):
        ComTask(**{gain: [1.0, 2.0]}).bind(robot)


@pytest.mark.parametrize("value", [[0.0, 0.0], np.zeros((3, 1)), 1.0, [0.0, NAN, 0.0], [INF] * 3])
def test_com_targets_that_cannot_be_right_are_refused(value):
    task = ComTask()
    for targets in ((value,), (np.zeros(3), value), (np.zeros(3), np.zeros(3), value)):
        with pytest.raises(TargetError, match="'com'"):
            task.set_target(*targets)
        assert task.target_position is None


def test_an_acceleration_set_before_binding_is_checked_at_binding(robot):
    task = ComTask("xy")
    task.set_acceleration([1.0, 2.0, 3.0])
    with pytest.raises(TargetError, match="acceleration of task 'com'"):
        task.bind(robot)
    task = ComTask("xy")
    task.bind(robot)
    for bad in ([1.0, 2.0, 3.0], [NAN, 0.0], 1.0):
        with pytest.raises(TargetError, match="acceleration of task 'com'"):
            task.set_acceleration(bad)


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
