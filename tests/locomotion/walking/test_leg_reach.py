"""Where the legs have to reach: the base that goes with a COM of the walk."""

import numpy as np
import pinocchio as pin
import pytest

from poise.locomotion import Stride, plan_footsteps
from poise.locomotion._walking._reach import LegReach
from poise.locomotion._walking._reference import ReferencePoint


@pytest.mark.parametrize("yaw", [0.0, 0.6, -2.0])
def test_the_robot_is_moved_and_turned_as_one_to_where_its_com_should_be(get_robot, yaw):
    robot = get_robot("g1")
    plan = plan_footsteps(robot, [Stride(steps=2, length=0.1)])
    com, displacement = np.zeros((3, 3)), np.zeros((3, 4))
    com[0], displacement[0, 3] = np.array(plan.com) + [0.7, -0.3, -0.05], yaw
    q = LegReach(robot, plan)._with_base_at(ReferencePoint(com, displacement))
    found = pin.centerOfMass(robot.model, robot.model.createData(), q)
    np.testing.assert_allclose(found, com[0], atol=1e-12)
    turned = pin.utils.rotate("z", yaw) @ pin.XYZQUATToSE3(plan.q[:7]).rotation
    np.testing.assert_allclose(pin.XYZQUATToSE3(q[:7]).rotation, turned, atol=1e-12)
    np.testing.assert_array_equal(q[7:], plan.q[7:])
