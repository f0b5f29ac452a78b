"""What a leg can do with its sole, where it has six joints and where it lacks some."""

import numpy as np
import pinocchio as pin
import pytest

from poise.robots import load_robot

ALL = (0, 1, 2, 3, 4, 5)
ROLL, YAW = ".*_ankle_roll", ".*_hip_yaw"


def leg_jacobian(robot, sole):
    """Motions of a sole along its own axes by its leg's joints, in leg lengths."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id(sole)
    joints = robot.leg_joints(sole)
    J = pin.computeFrameJacobian(model, data, robot.q_home, frame, pin.LOCAL)
    foot = pin.updateFramePlacement(model, data, frame).translation
    J[:3] /= np.linalg.norm(data.oMi[joints[0]].translation - foot)
    return J[:, [model.joints[j].idx_v for j in joints]]


@pytest.mark.parametrize("name", ["humanoid33", "g1", "talos", "biped20"])
def test_a_leg_of_six_joints_controls_all_of_its_sole(get_robot, name):
    for sole in get_robot(name).soles.values():
        assert sole.controlled == ALL
        assert sole.turns
        assert not sole.leans


@pytest.mark.parametrize(
    ("joints", "controlled"),
    [((ROLL,), (0, 1, 2, 4, 5)), ((YAW,), (0, 1, 2, 3, 4)), ((ROLL, YAW), (0, 1, 2, 4))],
)
def test_a_leg_that_lacks_joints_gives_up_the_turns_that_they_make(
    get_robot_without, joints, controlled
):
    robot = get_robot_without(*joints)
    for name, sole in robot.soles.items():
        assert sole.controlled == controlled
        assert sole.leans == (ROLL in joints)
        assert sole.turns == (YAW not in joints)
        J = leg_jacobian(robot, name)
        assert np.linalg.svd(J[list(controlled)], compute_uv=False).min() > 0.02
        assert np.linalg.matrix_rank(J, tol=1e-6) == len(controlled)


def test_a_leg_that_cannot_put_its_sole_aside_gives_up_no_turn(get_robot_without):
    robot = get_robot_without(".*_hip_roll", YAW, ROLL)
    assert [sole.controlled for sole in robot.soles.values()] == [ALL, ALL]


HOPPER = """<robot name="hopper">
  <link name="trunk">{inertial}</link><link name="foot">{inertial}</link>
  <joint name="leg" type="prismatic"><origin xyz="0 0 -0.8"/><parent link="trunk"/>
    <child link="foot"/><axis xyz="0 0 1"/>
    <limit lower="-0.2" upper="0.2" effort="500" velocity="1"/></joint></robot>"""
INERTIAL = """<inertial><mass value="3"/>
  <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>"""


def test_a_sole_at_the_origin_of_a_slide_is_no_error(tmp_path):
    path = tmp_path / "hopper.urdf"
    path.write_text(HOPPER.format(inertial=INERTIAL))
    sole = {"link": "foot", "length": 0.1, "width": 0.1}
    facts = {"base": "floating", "pelvis": "trunk", "torso": "trunk", "soles": {"sole": sole}}
    robot = load_robot(path, facts)
    assert robot.soles["sole"].controlled == ALL
