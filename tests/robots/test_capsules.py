"""Links as capsules: they hold their links, and know how far they are apart."""

import numpy as np
import pinocchio as pin
import pytest

from poise.robots import capsules_of
from poise.robots._geometry import link_shapes


def test_distances_are_the_least_of_points_of_the_axes(get_robot):
    robot = get_robot("biped20")
    capsules, data = capsules_of(robot), robot.model.createData()
    found = capsules.distances(robot, robot.q_home)
    np.testing.assert_array_equal(found, capsules.at_home)
    pin.forwardKinematics(robot.model, data, robot.q_home)
    shares, axes = np.linspace(0.0, 1.0, 201), []
    for joint, a, b in zip(capsules.joints, capsules.starts, capsules.ends, strict=True):
        axes.append([data.oMi[int(joint)] * (a + s * (b - a)) for s in shares])
    for (i, j), distance in zip(capsules.pairs, found, strict=True):
        apart = np.linalg.norm(np.array(axes[i])[:, None] - np.array(axes[j]), axis=2).min()
        least = apart - capsules.radii[i] - capsules.radii[j]
        assert least - 0.005 < distance <= least + 1e-9


@pytest.mark.parametrize("name", ["humanoid33", "biped20"])
def test_capsules_hold_what_their_links_are_made_of(get_robot, name):
    robot = get_robot(name)
    capsules = capsules_of(robot)
    shapes = link_shapes(robot.source, set(capsules.names), name)
    for link in set(capsules.names):
        own = [i for i, other in enumerate(capsules.names) if other == link]
        frame = robot.model.frames[robot.model.getFrameId(link, pin.FrameType.BODY)]
        shape = shapes[link].collision or shapes[link].visual
        for balls in shape:
            points = balls.moved(frame.placement)
            gaps = []
            for k in own:
                start, axis = capsules.starts[k], capsules.ends[k] - capsules.starts[k]
                along = np.clip((points.centres - start) @ axis / max(axis @ axis, 1e-12), 0, 1)
                aside = np.linalg.norm(points.centres - start - along[:, None] * axis, axis=1)
                gaps.append(aside + points.radii - capsules.radii[k])
            assert np.min(gaps, axis=0).max() < 1e-9


def test_arms_are_pairs_with_trunk_legs_and_each_other_and_neighbours_are_none(get_robot):
    capsules = capsules_of(get_robot("g1"))
    names = [tuple(capsules.names[i] for i in pair) for pair in capsules.pairs]
    pairs = {frozenset(pair) for pair in names}
    for one, other in (
        ("torso_link", "left_elbow_link"),
        ("left_wrist_yaw_link", "right_wrist_yaw_link"),
        ("left_hip_pitch_link", "left_wrist_yaw_link"),
        ("left_knee_link", "right_knee_link"),
        ("left_shoulder_pitch_link", "left_wrist_yaw_link"),
    ):
        assert frozenset((one, other)) in pairs
    for one, other in (
        ("left_knee_link", "left_ankle_pitch_link"),
        ("left_hip_pitch_link", "left_hip_yaw_link"),
        ("torso_link", "left_shoulder_pitch_link"),
    ):
        assert frozenset((one, other)) not in pairs


def test_they_are_found_once_a_robot(get_robot):
    robot = get_robot("biped20")
    assert capsules_of(robot) is capsules_of(robot)
