"""Reach of the legs: the base that goes with a CoM of the walk."""

import math

import numpy as np
import pinocchio as pin
import pytest

from poise.dynamics import Dynamics
from poise.locomotion import Stride, plan_footsteps
from poise.locomotion._walking._legs import measure_leg


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_a_com_as_high_as_a_foot_lets_it_be_stretches_the_leg(get_robot, name):
    robot = get_robot(name)
    plan = plan_footsteps(robot, [Stride(steps=2, length=0.1)])
    leg = measure_leg(Dynamics(robot), plan.soles[0], plan.q)
    lowered, stands = 0.85 * plan.com[2], 0.98 * plan.com[2]
    assert 0.0 < leg.beside(stands) < leg.beside(lowered) < leg.span
    assert leg.highest(leg.beside(lowered)) == pytest.approx(lowered)
    assert math.hypot(leg.beside(lowered), lowered + leg.rise) == pytest.approx(leg.span)


def test_the_quickest_foot_is_driven_by_all_of_the_hips_torque(get_robot):
    robot = get_robot("g1")
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
