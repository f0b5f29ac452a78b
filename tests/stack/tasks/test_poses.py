"""A pose may be given as people have it: SE3, 4 x 4, position and quaternion, lists, float32."""

import numpy as np
import pinocchio as pin
import pytest

from poise.errors import TargetError
from poise.stack import ComTask, FrameTask, RelativeFrameTask

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


@pytest.fixture(params=[lambda: FrameTask("f"), lambda: RelativeFrameTask("f", "g")])
def task(request):
    return request.param()


@pytest.mark.parametrize("form", FORMS)
def test_a_pose_is_taken_in_every_form(task, form):
    task.set_target(*FORMS[form])
    tolerance = 1e-6 if "32" in form else 1e-15
    np.testing.assert_allclose(task._target.position, POSE.translation, atol=tolerance)
    np.testing.assert_allclose(task._target.rotation, POSE.rotation, atol=tolerance)


def test_what_was_given_is_not_kept(task):
    matrix = POSE.homogeneous.copy()
    task.set_target(matrix)
    matrix[:] = 0.0
    np.testing.assert_array_equal(task._target.rotation, POSE.rotation)


def test_rates_go_with_a_pose():
    task = FrameTask("f")
    task.set_target(POSE, velocity=np.arange(6.0))
    np.testing.assert_array_equal(task._target.memory[12:18], np.arange(6.0))


BENT = POSE.homogeneous.copy()
BENT[3, 0] = 0.1
SCALED = POSE.homogeneous.copy()
SCALED[:3, :3] *= 2.0


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ((BENT,), "last row"),
        ((SCALED,), "not a rotation"),
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
    assert task._target.position is None
    assert task._target.rotation is None


def test_vectors_are_taken_from_lists_and_float32():
    task = ComTask()
    task.set_target(np.array([0.1, 0.2, 0.9], dtype=np.float32), [1, 0, 0])
    np.testing.assert_allclose(task.target_position, [0.1, 0.2, 0.9], atol=1e-7)
