import pytest

from poise.apps.report._plots._torque import grouped_order, guess_group


@pytest.mark.parametrize(
    ("name", "group"),
    [
        ("left_hip_pitch_joint", "left leg"),
        ("right_ankle_roll", "right leg"),
        ("leg_left_1_joint", "left leg"),
        ("arm_right_3_joint", "right arm"),
        ("LHipYaw", "left leg"),
        ("RShoulderPitch", "right arm"),
        ("l_elbow", "left arm"),
        ("torso_1_joint", "waist"),
        ("head_2_joint", "head"),
        ("gripper_left_joint", "left arm"),
        ("joint_7", "other"),
    ],
)
def test_the_group_is_guessed_from_the_name(name, group):
    assert guess_group(name) == group


def test_the_order_keeps_every_joint_once_and_groups_together():
    names = ["l_hip", "r_hip", "l_knee", "r_knee", "neck"]
    order, groups = grouped_order(names)
    assert order == [0, 2, 1, 3, 4]
    assert groups == [("left leg", 2), ("right leg", 2), ("head", 1)]
