"""What is measured of a leg, against forward kinematics in postures that it was not measured in."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from legs import PITCHES, bent, leg_joints, measured_leg

KNEE_MIN = 0.08
EXACT, NEAR = 1e-9, 0.025
"""How far from a point the axes of a hip or an ankle may be: on G1 they do not meet [m]."""

ROBOTS = [("biped20", EXACT, 9.0), ("talos", EXACT, 9.0), ("g1", NEAR, 0.5)]
"""And how far from home joints are: on G1 a hip is a point for steps, not for splits [rad]."""


def measured(robot, foot):
    sole = list(robot.soles)[foot]
    return sole, leg_joints(robot, sole), measured_leg(robot, sole)


def random_posture(robot, seed, spread):
    """Placements of joints and frames at a random configuration, by Pinocchio alone."""
    rng = np.random.default_rng(seed)
    q = robot.q_home.copy()
    q[:3] = rng.normal(size=3)
    q[3:7] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    low, high = np.maximum(robot.q_min, q[7:] - spread), np.minimum(robot.q_max, q[7:] + spread)
    q[7:] = rng.uniform(low, high)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    pin.computeJointJacobians(robot.model, data, q)
    return data


def world_hip(robot, data, leg):
    return data.oMf[robot.frame_id(robot.pelvis)].act(leg.hip)


@pytest.mark.parametrize(("name", "off", "spread"), ROBOTS)
@pytest.mark.parametrize("foot", [0, 1])
def test_the_hip_is_on_the_axes_of_its_three_joints(get_robot, name, off, spread, foot):
    robot = get_robot(name)
    _, joints, leg = measured(robot, foot)
    for seed in range(5):
        data = random_posture(robot, seed, spread)
        hip = world_hip(robot, data, leg)
        for joint in joints[:3]:
            axis = pin.getJointJacobian(robot.model, data, joint + 2, pin.WORLD)[3:, 6 + joint]
            way = hip - data.oMi[joint + 2].translation
            assert np.linalg.norm(np.cross(way, axis)) < off


@pytest.mark.parametrize(("name", "off", "spread"), ROBOTS)
@pytest.mark.parametrize("foot", [0, 1])
def test_thigh_and_shank_keep_their_lengths(get_robot, name, off, spread, foot):
    robot = get_robot(name)
    sole, joints, leg = measured(robot, foot)
    for seed in range(5):
        data = random_posture(robot, seed, spread)
        hip, knee = world_hip(robot, data, leg), data.oMi[joints[3] + 2].translation
        ankle = data.oMf[robot.frame_id(sole)].act(leg.ankle)
        assert ankle == pytest.approx(data.oMi[joints[-1] + 2].translation, abs=EXACT)
        assert np.linalg.norm(knee - hip) == pytest.approx(leg.thigh, abs=off)
        assert np.linalg.norm(ankle - knee) == pytest.approx(leg.shank, abs=off)


@pytest.mark.parametrize("name", ["biped20"])
def test_the_length_is_that_with_the_knee_as_straight_as_it_may_be(get_robot, name):
    leg = measured(get_robot(name), 0)[2]
    cosine = leg.thigh**2 + leg.shank**2 + 2.0 * leg.thigh * leg.shank * np.cos(KNEE_MIN)
    assert leg.length == pytest.approx(np.sqrt(cosine), abs=EXACT)


@pytest.mark.parametrize("name", ["biped20", "talos", "g1"])
@pytest.mark.parametrize("foot", [0, 1])
def test_the_shank_leans_forward_as_far_as_the_ankle_lets_it(get_robot, name, foot):
    robot = get_robot(name)
    sole, joints, leg = measured(robot, foot)
    pitch = joints[PITCHES[name][2]]

    def lean(angle):
        """Of the line from ankle to knee, over the sole."""
        dynamics = bent(robot, 0.0, 0.3, angle)
        frame = dynamics.frame(robot.frame_id(sole))
        knee = dynamics.joint_position(joints[3] + 2) - dynamics.joint_position(pitch + 2)
        x, _, z = frame.rotation.T @ knee
        return float(np.arctan2(x, z))

    assert lean(float(robot.q_min[pitch])) - lean(0.0) == pytest.approx(leg.lean_max, abs=1e-6)


def test_g1_has_the_ankles_of_its_data_sheet(get_robot):
    leg = measured(get_robot("g1"), 0)[2]
    assert leg.lean_max == pytest.approx(0.873, abs=1e-3)
    assert leg.roll_max == pytest.approx(0.262, abs=1e-3)


@pytest.mark.parametrize(("name", "sense"), [("biped20", 1.0), ("talos", 1.0), ("icub", -1.0)])
def test_knees_are_kept_bent_whichever_way_they_bend(get_robot, name, sense):
    robot = get_robot(name)
    _, joints, leg = measured(robot, 0)
    home = float(robot.q_home[7 + joints[3]])
    low, high = leg.knee_range
    assert sense * home > 0.0
    assert low <= home <= high
    # These count from the straight leg.
    assert sorted(np.abs([low, high])) == pytest.approx([KNEE_MIN, np.inf], abs=1e-5)


@pytest.mark.parametrize("foot", [0, 1])
def test_a_strong_hip_needs_no_relief_and_a_weak_one_a_bounded_one(get_robot, foot):
    robot = get_robot("biped20")
    sole, joints, leg = measured(robot, foot)
    assert leg.relief == 0.0
    reliefs: list[float] = []
    for part in (0.4, 0.3, 0.2, 0.01):
        torque = robot.tau_max.copy()
        torque[joints[:3]] *= part
        reliefs.append(measured_leg(replace(robot, tau_max=torque), sole).relief)
    assert reliefs == sorted(reliefs)
    assert reliefs[-1] == pytest.approx(0.2)


@pytest.mark.parametrize("foot", [0, 1])
def test_a_hip_that_does_not_turn_in_needs_relief(get_robot, foot):
    robot = get_robot("biped20")
    sole, joints, _ = measured(robot, foot)
    stiff = replace(robot, q_min=robot.q_min.copy(), q_max=robot.q_max.copy())
    for joint in joints[:3]:
        stiff.q_min[joint] = stiff.q_max[joint] = robot.q_home[7 + joint]
    assert measured_leg(stiff, sole).relief > 0.05


def test_both_legs_are_mirror_images(get_robot):
    left, right = (measured(get_robot("g1"), foot)[2] for foot in (0, 1))
    assert left.hip == pytest.approx(right.hip * [1.0, -1.0, 1.0], abs=1e-6)
    assert left.length == pytest.approx(right.length, abs=1e-6)
