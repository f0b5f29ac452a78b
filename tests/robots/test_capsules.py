"""Links as capsules: they hold their links, and know how far they are apart."""

import numpy as np
import pinocchio as pin
import pytest

from poise.robots import capsules_of
from poise.robots._capsules import segment_distances
from poise.robots._geometry import link_shapes


def test_distances_of_segments_are_the_least_of_their_points():
    rng = np.random.default_rng(0)
    a, b, c, d = rng.normal(size=(4, 30, 3))
    # Parallel ones, and points, too.
    b[0], d[0] = a[0] + [1.0, 0.0, 0.0], c[0] + [2.0, 0.0, 0.0]
    b[1], d[2] = a[1], c[2]
    s = np.linspace(0.0, 1.0, 201)[:, None]
    for k, found in enumerate(segment_distances(a, b, c, d)):
        one, other = a[k] + s * (b[k] - a[k]), c[k] + s * (d[k] - c[k])
        least = np.linalg.norm(one[:, None] - other[None], axis=2).min()
        assert least - 0.02 < found <= least + 1e-9


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
            for point, radius in zip(points.centres, points.radii, strict=True):
                gaps = [
                    segment_distances(
                        point[None],
                        point[None],
                        capsules.starts[i : i + 1],
                        capsules.ends[i : i + 1],
                    )[0]
                    - capsules.radii[i]
                    for i in own
                ]
                assert min(gaps) + radius < 1e-9


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
