"""No body winds itself up: joints about the vertical stay where the shorter way leads back."""

import itertools
import math

import numpy as np
import pytest

from poise.dynamics import Dynamics, RobotState
from poise.locomotion import StepTeleoperator
from poise.locomotion._stepping._by_torque._departures import twist_ranges


def led(robot):
    return StepTeleoperator(robot, actuation="torque")


@pytest.mark.parametrize(
    ("name", "waist"),
    [("g1", "waist_yaw_joint"), ("humanoid33", "waist_yaw"), ("talos", "torso_1_joint")],
)
def test_waist_and_hips_are_bounded_and_nothing_else(get_robot, name, waist):
    robot = get_robot(name)
    teleoperator = led(robot)
    found = twist_ranges(teleoperator._biped)
    assert waist in found
    assert len(found) == 3
    for joint, (lower, upper) in found.items():
        home = robot.q_home[7 + robot.joint_index(joint)]
        assert upper - home == pytest.approx(home - lower)
    limit = teleoperator.stack.joint_limit
    i = robot.joint_index(waist)
    assert found[waist][0] <= limit._q_min[i]
    assert limit._q_max[i] <= found[waist][1]


@pytest.mark.parametrize("name", ["g1", "humanoid33", "talos"])
def test_wound_up_as_far_as_they_go_the_shorter_way_still_leads_back(get_robot, name):
    """Farther than half a turn from the feet it would lead on, into the stops, and stay there."""
    robot = get_robot(name)
    teleoperator = led(robot)
    biped, limit = teleoperator._biped, teleoperator.stack.joint_limit
    *hips, waist = (robot.joint_index(joint) for joint in twist_ranges(biped))
    dynamics, yaws = Dynamics(robot), list[float]()
    bounds = limit._q_min, limit._q_max
    for hip_bound, waist_bound in itertools.product(bounds, bounds):
        q = robot.q_home.copy()
        q[7 + np.array(hips)], q[7 + waist] = hip_bound[hips], waist_bound[waist]
        dynamics.update(RobotState(q, np.zeros(robot.nv)))
        torso = dynamics.placement(biped.torso)[1]
        for frame in biped.frames:
            turned = dynamics.placement(frame)[1].T @ torso
            yaws.append(abs(math.atan2(turned[1, 0], turned[0, 0])))
    # Both turned the same way add up, to less than half a turn.
    assert 1.5 < max(yaws) < math.pi - 0.4
