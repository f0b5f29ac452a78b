"""Scenarios on robots of another size than the one that their lengths are written for."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

pytest.importorskip("mujoco")

from poise.apps.scenarios import load_scenario, parse_scenario, stage_scenario
from poise.apps.scenarios._size import size_ratio, without_hands

TEXT = """
name: s
robot: humanoid33
reference_com_height: {height}
duration: 6.0
plant:
  blocks:
    - {{center: [0.65, 0.2], size: [0.5, 1.2, 0.05], yaw: 0.3}}
walk:
  strides: [{{steps: 2, length: 0.1, sideways: 0.02, turn: 0.05}}]
  gait: {{step_time: 1.0, swing_height: 0.04, crouch: 0.01}}
motions:
  - {{task: left_hand, at: 0.2, over: 1.0, by: [0.06, 0.0, 0.1]}}
  - {{task: posture, at: 0.2, over: 1.0, joints: {{neck_pitch: 0.1}}}}
pushes:
  - {{body: torso, at: 1.0, duration: 0.1, velocity_change: [0.1, 0.0, 0.0]}}
checks:
  - {{metric: com_error_max, at_most: 0.01, until: 3.0}}
  - {{metric: com_travel, axis: x, at_least: 0.2}}
  - {{metric: com_speed_end, at_most: 0.05}}
  - {{metric: task_error_max, task: left_hand, at_most: 0.02}}
  - {{metric: task_error_max, task: left_foot, at_most: 0.03}}
  - {{metric: task_error_max, task: pelvis, at_most: 0.04}}
  - {{metric: steps_made, at_least: 2}}
  - {{metric: sole_force_max, sole: left_sole, at_most: 2000.0}}
"""


def com_height(robot):
    return float(pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)[2])


@pytest.fixture
def staged(get_robot):
    """The scenario on its robot, written for one that is twice as large, and for nobody."""
    height = com_height(get_robot("humanoid33"))
    half = stage_scenario(parse_scenario(TEXT.format(height=2.0 * height), "s.yaml"))
    written = parse_scenario(TEXT.format(height=height).replace("reference", "# "), "s.yaml")
    return half.scenario, stage_scenario(written).scenario


def test_lengths_are_scaled_and_nothing_else(staged):
    half, written = staged
    assert written.plant.blocks[0].size == (0.5, 1.2, 0.05)
    (block,) = half.plant.blocks
    assert block.center == pytest.approx((0.325, 0.1))
    assert block.size == pytest.approx((0.25, 0.6, 0.025))
    assert block.yaw == 0.3
    (stride,), gait = half.walk.strides, half.walk.gait
    assert (stride.steps, stride.turn, gait.step_time) == (2, 0.05, 1.0)
    assert (stride.length, stride.sideways) == pytest.approx((0.05, 0.01))
    assert (gait.swing_height, gait.crouch, gait.width) == (0.02, 0.005, None)
    np.testing.assert_allclose(half.motions[0].by, [0.03, 0.0, 0.05])
    assert half.motions[1] == written.motions[1]
    assert half.pushes[0].velocity_change == pytest.approx((0.1 * np.sqrt(0.5), 0.0, 0.0))
    assert replace(half.pushes[0], velocity_change=(0.1, 0.0, 0.0)) == written.pushes[0]


def test_bounds_in_metres_are_scaled_and_others_stay(staged):
    half, written = staged
    ratios = [a.bound / b.bound for a, b in zip(half.checks, written.checks, strict=True)]
    # An error of a whole pose has metres and radians in it; the pelvis has angles alone.
    assert ratios == pytest.approx([0.5, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 1.0])
    for a, b in zip(half.checks, written.checks, strict=True):
        assert (a.metric, a.subject, a.axis, a.begin, a.end, a.relation) == (
            b.metric, b.subject, b.axis, b.begin, b.end, b.relation,
        )  # fmt: skip


def test_a_robot_of_that_size_changes_nothing(get_robot):
    robot = get_robot("humanoid33")
    same = parse_scenario(TEXT.format(height=com_height(robot)), "s.yaml")
    assert size_ratio(same, robot) == 1.0
    # Files have rounded heights; what ships is written for this robot.
    assert size_ratio(load_scenario("squat"), robot) == 1.0
    assert size_ratio(replace(same, reference_com_height=None), get_robot("g1")) == 1.0


def test_a_robot_without_hands_walks_without_them(get_robot):
    scenario = load_scenario("walk")
    handless = replace(get_robot("humanoid33"), hands=())
    assert without_hands(scenario, get_robot("humanoid33")) is scenario
    left = without_hands(scenario, handless)
    assert left.motions == ()
    assert not [check for check in left.checks if "hand" in (check.task or "")]
    assert [check.metric for check in left.checks] == [
        check.metric for check in scenario.checks if "hand" not in (check.task or "")
    ]
    # A reach is nothing without hands, and is refused as it was.
    reach = load_scenario("reach")
    assert without_hands(reach, handless) is reach
