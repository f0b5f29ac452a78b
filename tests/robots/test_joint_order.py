"""Orders of joints: Poise's, MuJoCo's, Isaac Lab's, and that of Unitree's motors, both ways."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import JointOrder

ISAAC_OF_G1 = (
    "left_hip_pitch right_hip_pitch waist_yaw left_hip_roll right_hip_roll waist_roll "
    "left_hip_yaw right_hip_yaw waist_pitch left_knee right_knee "
    "left_shoulder_pitch right_shoulder_pitch left_ankle_pitch right_ankle_pitch "
    "left_shoulder_roll right_shoulder_roll left_ankle_roll right_ankle_roll "
    "left_shoulder_yaw right_shoulder_yaw left_elbow right_elbow left_wrist_roll right_wrist_roll "
    "left_wrist_pitch right_wrist_pitch left_wrist_yaw right_wrist_yaw"
)
"""As `joint_names` of the 29 joints in Isaac Lab, published with policies for the robot."""

ISAAC_TO_MOTORS = (
    *(0, 3, 6, 9, 13, 17, 1, 4, 7, 10, 14, 18, 2, 5, 8),
    *(11, 15, 19, 21, 23, 25, 27, 12, 16, 20, 22, 24, 26, 28),
)
"""Places in Isaac Lab's order of G1's motors, as deployments of such policies have them."""

MOTORS_OF_G1 = {
    "left_hip_pitch_joint": 0,
    "left_knee_joint": 3,
    "left_ankle_roll_joint": 5,
    "right_hip_yaw_joint": 8,
    "waist_yaw_joint": 12,
    "waist_pitch_joint": 14,
    "left_shoulder_pitch_joint": 15,
    "left_wrist_yaw_joint": 21,
    "right_elbow_joint": 25,
    "right_wrist_yaw_joint": 28,
}
"""Some of `G1JointIndex`."""


def both_ways(one, other):
    there, back = one.to(other), other.to(one)
    values = np.random.default_rng(0).normal(size=(4, len(one.names)))
    named = dict(zip(one.names, values[1], strict=True))
    moved = there(values)
    assert dict(zip(other.names, moved[1], strict=True)) == named
    np.testing.assert_array_equal(back(moved), values)
    np.testing.assert_array_equal(values[:, one.index(other)], moved)
    return moved


def reversed_mujoco(robot, prefix=""):
    """A MuJoCo model of a robot's tree whose branches, and then motors, stand the other way round.

    It has a ball and another hinge before the robot.
    """
    spec = mujoco.MjSpec()
    ball = spec.worldbody.add_body(name="ball")
    ball.add_freejoint()
    ball.add_geom(size=(0.1, 0, 0))
    door = spec.worldbody.add_body(name="door")
    door.add_joint(name="hinge")
    door.add_geom(size=(0.1, 0, 0))
    bodies = {1: spec.worldbody.add_body(name="base")}
    bodies[1].add_freejoint(name="root")
    bodies[1].add_geom(size=(0.1, 0, 0))
    model = robot.model
    for parent in range(1, model.njoints):
        for j in reversed([j for j in range(2, model.njoints) if model.parents[j] == parent]):
            bodies[j] = bodies[parent].add_body(name=f"{prefix}body{j}")
            bodies[j].add_joint(name=prefix + model.names[j])
            bodies[j].add_geom(size=(0.1, 0, 0))
    for k in np.random.default_rng(2).permutation(robot.nj):
        motor = spec.add_actuator(target=prefix + robot.joint_names[k])
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
    return spec.compile()


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_a_mujoco_model_in_another_order_has_each_joint_by_its_name(get_robot, name):
    robot = get_robot(name)
    model = reversed_mujoco(robot, "here/")
    ours, theirs = JointOrder.of(robot), JointOrder.from_mujoco(model, prefix="here/")
    assert ours.names != theirs.names
    moved = both_ways(ours, theirs)
    # Behind two free joints and a hinge they are what stands in qpos.
    data = mujoco.MjData(model)
    data.qpos[-robot.nj :] = moved[1]
    for k, joint in enumerate(robot.joint_names):
        given = theirs.to(ours)(moved)[1][k]
        assert data.joint(f"here/{joint}").qpos[0] == given
    assert "hinge" in JointOrder.from_mujoco(model).names
    motors = JointOrder.from_mujoco(model, prefix="here/", actuators=True)
    assert motors.names not in (ours.names, theirs.names)
    data.ctrl[:] = ours.to(motors)(np.arange(float(robot.nj)))
    mujoco.mj_forward(model, data)
    force = theirs.to(ours)(data.qfrc_actuator[-robot.nj :])
    np.testing.assert_array_equal(force, np.arange(robot.nj))


def test_isaac_lab_orders_g1_as_published_with_its_policies(get_robot):
    robot = get_robot("g1")
    isaac, motors = JointOrder.breadth_first(robot), JointOrder.unitree_dds("g1")
    assert isaac.names == tuple(f"{name}_joint" for name in ISAAC_OF_G1.split())
    assert tuple(isaac.index(motors)) == ISAAC_TO_MOTORS
    both_ways(isaac, motors)
    both_ways(JointOrder.of(robot), isaac)


@pytest.mark.parametrize("name", ["humanoid33", "talos", "arm6", "upper17"])
def test_breadth_first_goes_by_depth_then_as_parents_stand_then_by_name(get_robot, name):
    robot = get_robot(name)
    names = JointOrder.breadth_first(robot).names
    assert sorted(names) == sorted(robot.joint_names)
    model, place = robot.model, {name: k for k, name in enumerate(names)}
    ids = [model.getJointId(name) for name in names]
    keys = [
        (len(model.supports[j]), place.get(model.names[model.parents[j]], -1), model.names[j])
        for j in ids
    ]
    assert keys == sorted(keys)


def test_joints_on_one_link_come_by_name_and_not_as_the_model_has_them(get_robot):
    model = pin.Model()
    trunk = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "trunk")
    for name in ("right", "left"):
        arm = model.addJoint(trunk, pin.JointModelRX(), pin.SE3.Identity(), name)
        model.addJoint(arm, pin.JointModelRX(), pin.SE3.Identity(), f"a_{name}_hand")

    robot = replace(get_robot("arm6"), model=model, joint_names=tuple(model.names)[1:])
    assert robot.joint_names[1] == "right"
    expected = ("trunk", "left", "right", "a_left_hand", "a_right_hand")
    assert JointOrder.breadth_first(robot).names == expected


def test_unitrees_motors_are_where_its_sdk_has_them(get_robot):
    motors = JointOrder.unitree_dds("g1")
    assert len(motors.names) == 29
    assert {name: motors.names.index(name) for name in MOTORS_OF_G1} == MOTORS_OF_G1
    assert sorted(motors.names) == sorted(get_robot("g1").joint_names)
    other = JointOrder.unitree_dds("h1_2")
    assert len(other.names) == 27
    assert other.names[:2] == ("left_hip_yaw_joint", "left_hip_pitch_joint")
    assert other.names[12:14] == ("torso_joint", "left_shoulder_pitch_joint")
    assert other.names[-1] == "right_wrist_yaw_joint"
    with pytest.raises(UnknownNameError, match="'h1'; choices: .*g1"):
        JointOrder.unitree_dds("h1")


def test_joints_that_an_order_lacks_are_named_unless_a_value_stands_for_them():
    less, more = JointOrder(["b", "a"]), JointOrder(["a", "x", "b", "y"])
    with pytest.raises(UnknownNameError, match=r"got \['x', 'y'\].*`fill`"):
        less.to(more)
    with pytest.raises(UnknownNameError, match=r"got \['x', 'y'\]"):
        less.index(more)
    np.testing.assert_array_equal(less.to(more, fill=7.0)([1.0, 2.0]), [2.0, 7.0, 1.0, 7.0])
    np.testing.assert_array_equal(more.to(less)([1.0, 2.0, 3.0, 4.0]), [3.0, 1.0])
    nothing = JointOrder(["z"]).to(less, fill=np.nan)([1.0])
    assert np.isnan(nothing).all()


def test_what_cannot_be_an_order_or_its_values_is_refused():
    with pytest.raises(ConfigurationError, match=r"twice.*'a', 'b', 'a'"):
        JointOrder(["a", "b", "a"])
    take = JointOrder(["a", "b"]).to(JointOrder(["b", "a"]))
    for wrong in (1.0, [1.0], np.zeros((2, 3))):
        with pytest.raises(ConfigurationError, match=r"\(\.\.\., 2\)"):
            take(wrong)
