"""What a leg can do with its sole, where it has six joints and where it lacks some."""

import numpy as np
import pytest

from poise.robots._sole_freedom import _leg_jacobian

ALL = (0, 1, 2, 3, 4, 5)
ROLL, YAW = ".*_ankle_roll", ".*_hip_yaw"


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
        J = _leg_jacobian(robot, name)
        assert np.linalg.svd(J[list(controlled)], compute_uv=False).min() > 0.02
        assert np.linalg.matrix_rank(J, tol=1e-6) == len(controlled)


def test_a_leg_that_cannot_put_its_sole_aside_gives_up_no_turn(get_robot_without):
    robot = get_robot_without(".*_hip_roll", YAW, ROLL)
    assert [sole.controlled for sole in robot.soles.values()] == [ALL, ALL]


def test_a_robot_without_soles_has_nothing_to_control(get_robot):
    assert not get_robot("arm6").soles
