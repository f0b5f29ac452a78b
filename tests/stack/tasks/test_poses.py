"""A pose may be given as people have it: SE3, 4 x 4, position and quaternion, lists, float32."""

import re

import numpy as np
import pinocchio as pin
import pytest

import poise
from poise.errors import TargetError
from poise.stack import ComTask, FrameTask

POSE = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.9])), np.array([0.4, -0.1, 0.8]))
QUATERNION = pin.Quaternion(POSE.rotation).coeffs()

FORMS = {
    "SE3": (POSE,),
    "4 x 4": (POSE.homogeneous,),
    "4 x 4 in lists": (POSE.homogeneous.tolist(),),
    "4 x 4 in float32": (POSE.homogeneous.astype(np.float32),),
    "pair with a quaternion": ((POSE.translation, QUATERNION),),
    "pair in lists": ([POSE.translation.tolist(), QUATERNION.tolist()],),
    "pair with a matrix": ((POSE.translation, POSE.rotation),),
    "position, quaternion": (POSE.translation, QUATERNION),
    "position, other quaternion": (POSE.translation, -QUATERNION),
    "position, matrix in lists": (POSE.translation.tolist(), POSE.rotation.tolist()),
    "float32": (POSE.translation.astype(np.float32), QUATERNION.astype(np.float32)),
}


@pytest.fixture
def task():
    return FrameTask("f")


@pytest.mark.parametrize("form", FORMS)
def test_a_pose_is_taken_in_every_form(task, form):
    task.set_target(*FORMS[form])
    tolerance = 1e-6 if "32" in form else 1e-15
    np.testing.assert_allclose(task.target_position, POSE.translation, atol=tolerance)
    np.testing.assert_allclose(task.target_rotation, POSE.rotation, atol=tolerance)


def test_what_was_given_is_not_kept(task):
    matrix = POSE.homogeneous.copy()
    task.set_target(matrix)
    matrix[:] = 0.0
    np.testing.assert_array_equal(task.target_rotation, POSE.rotation)


@pytest.mark.parametrize(
    ("axes", "place"),
    [
        ("position", {"position": POSE.translation}),
        ("position_xz", {"position": POSE.translation}),
        ("orientation", {"rotation": POSE.rotation}),
        ("orientation_z", {"rotation": POSE.rotation}),
    ],
)
def test_three_rates_are_those_that_a_task_of_one_kind_follows(get_robot, axes, place):
    robot, rates = get_robot("humanoid33"), np.arange(1.0, 13.0).reshape(2, 6)
    half = slice(0, 3) if axes.startswith("position") else slice(3, 6)
    short, long = FrameTask("left_hand", axes), FrameTask("left_hand", axes)
    short.set_target(**place, velocity=rates[0, half].tolist(), acceleration=rates[1, half])
    long.set_target(**place, velocity=rates[0], acceleration=rates[1])
    dynamics = poise.Dynamics(robot)
    for task in (short, long):
        task.bind(robot)
        task.evaluate(dynamics)
    np.testing.assert_array_equal(short.error_rate, long.error_rate)
    np.testing.assert_array_equal(short.reference, long.reference)
    assert np.abs(short.error_rate).max() > 0.5


@pytest.mark.parametrize(
    ("axes", "rates", "wanted"),
    [
        ("pose", np.ones(3), "(6,), linear then angular"),
        ("position+orientation_z", np.ones(3), "(6,), linear then angular"),
        ("position", np.ones(2), "(6,), linear then angular, or (3,), linear alone"),
        ("orientation", np.ones((1, 3)), "(6,), linear then angular, or (3,), angular alone"),
    ],
)
def test_rates_of_another_length_are_refused_and_change_nothing(axes, rates, wanted):
    task = FrameTask("f", axes)
    for given in ("velocity", "acceleration"):
        wrong = f"{given} of task 'f {axes}' has the wrong shape; got {rates.shape}; "
        with pytest.raises(TargetError, match=re.escape(f"{wrong}wanted {wanted}")):
            task.set_target(POSE, **{given: rates})
        assert task.target_position is None


BENT = POSE.homogeneous.copy()
BENT[3, 0] = 0.1
SCALED = POSE.homogeneous.copy()
SCALED[:3, :3] *= 2.0


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ((BENT,), "last row"),
        ((SCALED,), "not a rotation"),
        ((np.zeros(3), np.eye(2)), "rotation"),
        ((np.zeros(3), np.diag([1.0, 1.0, -1.0])), "not a rotation"),
        ((np.zeros(3), np.eye(3) + 1e-3 * np.eye(3, k=1)), "not a rotation"),
        ((np.array([np.nan, 0.0, 0.0]),), "NaN"),
        ((POSE, POSE.rotation), "one alone"),
        ((POSE.translation, 1.1 * QUATERNION), "length"),
        (((POSE.translation, np.full(4, np.nan)),), "NaN"),
        ((np.zeros((4, 3)),), "wrong shape"),
        (([0.0, 0.0],), "wrong shape"),
        (([0.0, 0.0, 0.0, 1.0],), "wrong shape"),
        ((POSE.homogeneous[None],), "wrong shape"),
        (([[1.0], [1.0, 2.0], 3.0, 4.0],), "numbers"),
    ],
)
def test_what_is_no_pose_is_refused_and_changes_nothing(task, target, said):
    with pytest.raises(TargetError, match=said):
        task.set_target(*target)
    assert task.target_position is None
    assert task.target_rotation is None


def test_vectors_are_taken_from_lists_and_float32():
    task = ComTask()
    task.set_target(np.array([0.1, 0.2, 0.9], dtype=np.float32), [1, 0, 0])
    np.testing.assert_allclose(task.target_position, [0.1, 0.2, 0.9], atol=1e-7)
