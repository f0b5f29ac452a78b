"""Where the legs have to reach: the base that goes with a COM of the walk."""

import math

import numpy as np
import pinocchio as pin
import pytest

from poise.dynamics import Dynamics
from poise.locomotion import Stride, plan_footsteps
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._legs import LegReach, measure_leg


@pytest.mark.parametrize("yaw", [0.0, 0.6, -2.0])
def test_the_robot_is_moved_and_turned_as_one_to_where_its_com_should_be(get_robot, yaw):
    robot = get_robot("g1")
    plan = plan_footsteps(robot, [Stride(steps=2, length=0.1)])
    left = Placement(position=(0.7, 0.1, 0.05), yaw=yaw + 0.1)
    right = Placement(position=(0.5, -0.1, 0.0), yaw=yaw - 0.1)
    base = LegReach(robot, plan)._base_between((left, right), 0, 0.6, 0.65)
    q = plan.q.copy()
    q[:7] = pin.SE3ToXYZQUAT(base)
    found = pin.centerOfMass(robot.model, robot.model.createData(), q)
    np.testing.assert_allclose(found, (0.62, 0.02, 0.65), atol=1e-12)
    turned = pin.utils.rotate("z", yaw) @ pin.XYZQUATToSE3(plan.q[:7]).rotation
    np.testing.assert_allclose(base.rotation, turned, atol=1e-12)


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_a_com_as_high_as_a_foot_lets_it_be_stretches_the_leg(get_robot, name):
    robot = get_robot(name)
    plan = plan_footsteps(robot, [Stride(steps=2, length=0.1)])
    leg = measure_leg(Dynamics(robot), plan.soles[0], plan.q)
    lowered, stands = 0.85 * plan.com[2], 0.98 * plan.com[2]
    assert 0.0 < leg.beside(stands) < leg.beside(lowered) < leg.span
    assert leg.highest(leg.beside(lowered)) == pytest.approx(lowered)
    assert math.hypot(leg.beside(lowered), lowered + leg.rise) == pytest.approx(leg.span)


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_the_quickest_foot_is_driven_by_all_of_the_hips_torque(get_robot, name):
    robot = get_robot(name)
    plan = plan_footsteps(robot, [Stride(steps=2, length=0.1)])
    found = measure_leg(Dynamics(robot), plan.soles[0], plan.q).quickness
    model, data = robot.model, robot.model.createData()
    hip = next(k for k, joint in enumerate(robot.joint_names) if "left_hip_pitch" in joint)
    column = robot.base_dofs + hip
    inertia = pin.crba(model, data, plan.q)[column, column]
    # Only the hip moves: its torque over its inertia, at the end of the leg.
    v = np.zeros(robot.nv)
    v[column] = robot.tau_max[hip] / inertia
    pin.forwardKinematics(model, data, plan.q, v)
    sole = pin.getFrameVelocity(model, data, robot.frame_id(plan.soles[0]), pin.LOCAL).linear
    assert found == pytest.approx(abs(float(sole[0])))
