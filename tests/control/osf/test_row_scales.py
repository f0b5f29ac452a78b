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
