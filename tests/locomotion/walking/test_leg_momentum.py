"""The pendulum with heavy legs, against the momentum of the whole robot."""

import numpy as np
import pinocchio as pin
import pytest

from poise.locomotion._walking._dcm import leg_ratios


@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_a_leg_turns_about_the_com_as_the_ratio_says(name, get_robot):
    robot = get_robot(name)
    q, model = robot.q_home, robot.model
    soles = tuple(robot.soles)
    ratios = leg_ratios(robot, q, soles)
    data, ahead = model.createData(), np.zeros(model.nv)
    frame = robot.frame_id(soles[0])
    jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    leg = [model.joints[j].idx_v for j in model.supports[model.frames[frame].parentJoint] if j > 1]
    ahead[leg] = np.linalg.lstsq(jacobian[:, leg], np.eye(6)[0], rcond=None)[0]
    # By differences of positions: the momentum of every body about the CoM.
    step = 1e-6
    momentum = np.zeros(3)
    pin.forwardKinematics(model, data, q)
    com = pin.centerOfMass(model, data, q).copy()
    places = [data.oMi[j].act(model.inertias[j].lever) for j in range(model.njoints)]
    pin.centerOfMass(model, data, pin.integrate(model, q, step * ahead))
    for j in range(1, model.njoints):
        body = model.inertias[j]
        velocity = (data.oMi[j].act(body.lever) - places[j]) / step
        momentum += np.cross(places[j] - com, body.mass * velocity)
    pin.forwardKinematics(model, data, q, ahead)
    for j in range(1, model.njoints):
        R = data.oMi[j].rotation
        momentum += R @ model.inertias[j].inertia @ data.v[j].angular
    assert momentum[1] == pytest.approx(-ratios.ahead * robot.mass * com[2], rel=0.05)
    assert 0.5 < ratios.rise < 2.0


@pytest.mark.parametrize("yaw", [1.5708, -2.0])
def test_legs_are_as_heavy_wherever_the_robot_faces(yaw, get_robot):
    robot = get_robot("g1")
    turn, turned = pin.exp3(np.array([0.0, 0.0, yaw])), robot.q_home.copy()
    turned[:3] = turn @ turned[:3]
    turned[3:7] = pin.Quaternion(turn @ pin.Quaternion(turned[3:7]).matrix()).coeffs()
    soles = tuple(robot.soles)
    expected = leg_ratios(robot, robot.q_home, soles)
    assert leg_ratios(robot, turned, soles) == pytest.approx(expected, abs=1e-9)
