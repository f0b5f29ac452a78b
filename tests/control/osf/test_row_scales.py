"""What rows are measured against where ranks are decided: their mobility in the home posture."""

from itertools import accumulate, pairwise

import numpy as np
import pytest
from osf_world import Rows

from poise.dynamics import RobotState
from poise.stack import ComTask, FrameTask, PointContact, PostureTask, Stack, SurfaceContact


@pytest.mark.parametrize("contact", [SurfaceContact, PointContact])
def test_the_most_mobile_row_of_a_block_counts_as_its_weight(get_any, contact):
    """scale = weight / sqrt(max_i J_i M^-1 J_i^T), for the rows of each block together."""
    robot = get_any("humanoid33")
    levels = [
        [ComTask(weight=2.0), FrameTask(robot.hands[0], weight=0.5)],
        [PostureTask(weight=3.0)],
    ]
    world = Rows(robot, Stack([contact(sole) for sole in robot.soles], levels))
    rows = world.at(RobotState(robot.q_home, np.zeros(robot.nv)))
    stack_rows, M = world.rows.stack_rows, world.dynamics.M
    mobility = np.sqrt(np.einsum("ij,ji->i", rows.jacobian, np.linalg.solve(M, rows.jacobian.T)))
    contacts = zip(stack_rows.contacts, stack_rows.wrench_slices, strict=True)
    places = [(owner, place, 1.0) for owner, place in contacts]
    places += [(task, place, task.weight[0]) for task, place in stack_rows.task_rows]
    assert len(places) == len(robot.soles) + 3
    for owner, place, weight in places:
        for begin, end in pairwise(accumulate(owner.blocks, initial=place.start)):
            expected = np.full(end - begin, weight / mobility[begin:end].max())
            np.testing.assert_allclose(rows.scale[begin:end], expected, rtol=1e-9)


def test_joints_become_a_level_of_their_own_behind_the_physics(get_any):
    robot = get_any("humanoid33")
    stack = Stack([SurfaceContact("left_sole")], [[ComTask()], [PostureTask()]])
    rows = Rows(robot, stack).at(RobotState(robot.q_home, np.zeros(robot.nv)))
    index, target, scale = np.array([8, 11]), np.array([1.0, -2.0]), np.array([3.0, 4.0])
    more = rows.with_held(np.eye(robot.nv)[index], target, scale)
    assert [s.stop - s.start for s in more.slices] == [6, 2, 3, robot.nj]
    assert [s.start for s in more.slices] == [0, 6, 8, 11]
    np.testing.assert_array_equal(more.jacobian[6:8], np.eye(robot.nv)[index])
    np.testing.assert_array_equal(more.target[6:8], target)
    np.testing.assert_array_equal(more.scale[6:8], scale)
    for before, after in zip(rows.slices, (more.slices[0], *more.slices[2:]), strict=True):
        np.testing.assert_array_equal(more.jacobian[after], rows.jacobian[before])
        np.testing.assert_array_equal(more.target[after], rows.target[before])
