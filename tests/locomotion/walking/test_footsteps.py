"""Footstep plans: where feet go, and what is refused before anything moves."""

import math

import numpy as np
import pinocchio as pin
import pytest

from poise.errors import ConfigurationError, TargetError
from poise.locomotion import FootstepPlan, Gait, Ground, Stride, plan_footsteps
from poise.locomotion._walking._ground import clear_swing

GAIT = Gait(step_time=0.8, crouch=0.02)


def positions(plan):
    return np.array([step.goal.position for step in plan.steps])


def side_by_side(plan):
    """Vector from the right to the left sole at the end, along the robot's own axes."""
    left, right = plan.placements(plan.count)
    apart = np.subtract(left.position, right.position)[:2]
    c, s = math.cos(left.yaw), math.sin(left.yaw)
    return np.array([[c, s], [-s, c]]) @ apart, left.yaw - right.yaw


STRIDES = {
    "ahead": [Stride(steps=6, length=0.15)],
    "back": [Stride(steps=5, length=-0.1)],
    "left": [Stride(steps=6, sideways=0.04)],
    "right": [Stride(steps=5, sideways=-0.03)],
    "left turn": [Stride(steps=8, length=0.1, turn=0.1)],
    "right turn": [Stride(steps=7, turn=-0.12)],
    "mixed": [
        Stride(steps=3, length=0.2),
        Stride(steps=4, turn=0.1),
        Stride(steps=2, sideways=-0.02),
    ],
}


@pytest.mark.parametrize("way", STRIDES)
def test_a_walk_begins_at_the_soles_and_ends_with_the_feet_side_by_side(get_robot, way):
    robot = get_robot("humanoid33")
    plan = plan_footsteps(robot, STRIDES[way], GAIT)
    begin = np.subtract(plan.start[0].position, plan.start[1].position)[:2]
    apart, turned = side_by_side(plan)
    np.testing.assert_allclose(apart, [0.0, np.linalg.norm(begin)], atol=1e-9)
    assert turned == pytest.approx(0.0, abs=1e-12)
    assert plan.count == sum(s.steps for s in STRIDES[way]) + 1
    assert all(a.foot != b.foot for a, b in zip(plan.steps, plan.steps[1:], strict=False))


def test_what_goes_sideways_and_turns_goes_as_far_as_it_says(get_robot):
    robot = get_robot("g1")
    aside = plan_footsteps(robot, [Stride(steps=6, sideways=0.04)], GAIT)
    middle = np.mean([p.position for p in aside.placements(aside.count)], axis=0)
    assert middle[1] == pytest.approx(6 * 0.04)
    turn = plan_footsteps(robot, [Stride(steps=6, turn=0.1)], GAIT)
    assert turn.placements(turn.count)[0].yaw == pytest.approx(6 * 0.1)


@pytest.mark.parametrize("way", STRIDES)
def test_a_walk_from_elsewhere_is_the_same_walk_moved_and_turned(get_robot, way):
    robot, yaw, at = get_robot("g1"), 2.0, np.array([3.0, -2.0])
    turned = pin.utils.rotate("z", yaw)
    q = robot.q_home.copy()
    q[:2] = turned[:2, :2] @ q[:2] + at
    q[3:7] = (pin.Quaternion(turned) * pin.Quaternion(q[3:7].copy())).coeffs()
    here, there = (plan_footsteps(robot, STRIDES[way], GAIT, q=q) for q in (robot.q_home, q))
    expected = positions(here) @ turned.T + [*at, 0.0]
    np.testing.assert_allclose(positions(there), expected, atol=1e-6)
    for a, b in zip(here.steps, there.steps, strict=True):
        assert b.goal.yaw == pytest.approx(a.goal.yaw + yaw, abs=1e-6)
    np.testing.assert_allclose(there.middle, turned @ here.middle + [*at, 0.0], atol=1e-6)


@pytest.mark.parametrize("axis", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
def test_soles_that_do_not_lie_flat_are_refused(get_robot, axis):
    robot = get_robot("humanoid33")
    for tilt, flat in ((0.04, True), (-0.04, True), (0.06, False), (-0.06, False)):
        q = robot.q_home.copy()
        q[3:7] = pin.Quaternion(pin.exp3(tilt * np.array(axis))).coeffs()
        if flat:
            assert plan_footsteps(robot, [Stride(steps=2)], GAIT, q=q).count == 3
        else:
            with pytest.raises(ConfigurationError, match="does not lie flat"):
                plan_footsteps(robot, [Stride(steps=2)], GAIT, q=q)


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_a_platform_is_as_long_and_as_wide_as_it_says_where_it_is_turned_to(yaw):
    platform = Ground.Platform(center=(3.0, -2.0), size=(0.4, 0.2, 0.1), yaw=yaw)
    c, s = math.cos(yaw), math.sin(yaw)
    ends = [[0.19, 0.09], [-0.19, -0.09], [0.21, 0.0], [-0.21, 0.0], [0.0, 0.11], [0.0, -0.11]]
    points = np.array(ends) @ np.array([[c, s], [-s, c]]) + [3.0, -2.0]
    np.testing.assert_array_equal(platform.heights(points), [0.1, 0.1, 0.0, 0.0, 0.0, 0.0])
    heights = Ground(height=0.5, platforms=(platform,)).heights(points)
    np.testing.assert_allclose(heights, [0.6, 0.6, 0.5, 0.5, 0.5, 0.5])


BLOCK = Ground.Platform(center=(0.65, 0.0), size=(0.5, 1.2, 0.05))


@pytest.mark.parametrize("robot", ["humanoid33", "g1"])
def test_footholds_stay_off_the_edges_of_a_platform(get_robot, robot):
    robot = get_robot(robot)
    ground = Ground(platforms=(BLOCK,))
    gait = Gait(step_time=1.1, swing_height=0.04)
    plan = plan_footsteps(robot, [Stride(steps=14, length=0.1)], gait, ground=ground)
    levels = set()
    for step in plan.steps:
        x, half = step.goal.position[0], 0.5 * plan.sizes[step.foot][0]
        for edge in (0.4, 0.9):
            assert abs(x - edge) > half + 0.01
        on = 0.4 < x < 0.9
        assert step.goal.position[2] == (0.05 if on else 0.0)
        levels.add(on)
    assert levels == {True, False}


def test_a_swing_clears_a_platform_all_the_way(get_robot):
    robot = get_robot("humanoid33")
    ground = Ground(platforms=(Ground.Platform(center=(0.49, 0.0), size=(0.08, 1.2, 0.05)),))
    plan = plan_footsteps(robot, [Stride(steps=6, length=0.2)], Gait(step_time=1.0), ground=ground)
    over = 0
    feet = list(plan.start)
    for step in plan.steps:
        begin, end = feet[step.foot], step.goal
        size = plan.sizes[step.foot]
        shape = clear_swing(begin, end, size, plan.gait.swing_height, ground)
        for phase in np.linspace(0.0, 1.0, 101).tolist():
            ratio = shape.progress(phase)
            x = begin.position[0] + ratio * (end.position[0] - begin.position[0])
            half = 0.5 * size[0]
            if x + half > 0.45 and x - half < 0.53:
                over += 1
                height, _, _ = shape.height(phase, begin.position[2], end.position[2])
                assert height > 0.05 + 0.005
        feet[step.foot] = end
    assert over > 10


def test_footholds_of_ones_own_are_the_plan(get_robot):
    """Given those of a plan by strides, on a block, with headings a whole turn on, the same."""
    robot, ground = get_robot("humanoid33"), Ground(platforms=(BLOCK,))
    strides, gait = [Stride(steps=6, length=0.1, turn=0.02)], Gait(step_time=1.1)
    planned = plan_footsteps(robot, strides, gait, ground=ground)
    footholds = [
        (planned.soles[step.foot], [*step.goal.position[:2], step.goal.yaw + 2.0 * math.pi * turns])
        for step, turns in zip(planned.steps, [0, 1, -1, 0, 2, 0, 0], strict=True)
    ]
    given = FootstepPlan.from_footholds(robot, footholds, gait, ground=ground)
    np.testing.assert_allclose(positions(given), positions(planned), atol=1e-12)
    for a, b in zip(given.steps, planned.steps, strict=True):
        assert a.foot == b.foot
        assert a.goal.yaw == pytest.approx(b.goal.yaw, abs=1e-12)


@pytest.mark.parametrize(
    ("footholds", "error", "message"),
    [
        ([], ConfigurationError, "plan without steps"),
        ([("left_hand", (0.1, 0.1, 0.0))], ConfigurationError, "step 1.*no sole.*left_sole"),
        ([("left_sole", (0.1, 0.1))], TargetError, "foothold 1 of the plan has the wrong shape"),
        ([("left_sole", (0.1, np.nan, 0.0))], TargetError, "foothold 1 of the plan holds NaN"),
        ([("left_sole", (0.4, 0.1, 0.0))], ConfigurationError, "does not carry the whole sole"),
        ([("left_sole", (0.0, -0.1, 0.0))], ConfigurationError, "step 1 .*across each other"),
        (
            [("left_sole", (0.0, 0.1, 0.0)), ("left_sole", (0.1, 0.1, 0.0))],
            ConfigurationError,
            "step 2 of the plan is made with the foot of",
        ),
    ],
)
def test_footholds_that_cannot_be_walked_are_refused(get_robot, footholds, error, message):
    with pytest.raises(error, match=message):
        FootstepPlan.from_footholds(
            get_robot("humanoid33"), footholds, ground=Ground(platforms=(BLOCK,))
        )


def test_a_robot_without_two_soles_is_refused(get_robot):
    with pytest.raises(ConfigurationError, match="cannot walk on two feet"):
        plan_footsteps(get_robot("arm6"), [Stride(steps=4, length=0.1)])


@pytest.mark.parametrize(
    ("strides", "gait", "message"),
    [
        ([], GAIT, "without strides"),
        ([Stride(steps=4)], Gait(width=0.05), "brings the feet together"),
        ([Stride(steps=4, turn=0.9)], GAIT, "brings the feet together"),
    ],
    ids=["no strides", "feet on each other", "soles across each other"],
)
def test_a_plan_that_cannot_be_walked_is_refused(get_robot, strides, gait, message):
    with pytest.raises(ConfigurationError, match=message):
        plan_footsteps(get_robot("humanoid33"), strides, gait)


def test_a_place_too_narrow_for_a_foot_is_refused(get_robot):
    strips = tuple(
        Ground.Platform(center=(0.2 + 0.1 * i, 0.0), size=(0.05, 1.2, 0.02)) for i in range(12)
    )
    with pytest.raises(ConfigurationError, match="no place that carries the whole sole"):
        plan_footsteps(
            get_robot("humanoid33"),
            [Stride(steps=6, length=0.15)],
            GAIT,
            ground=Ground(platforms=strips),
        )


def test_a_swing_too_low_for_what_is_in_its_way_is_refused(get_robot):
    with pytest.raises(ConfigurationError, match="knock against a platform"):
        plan_footsteps(
            get_robot("g1"),
            [Stride(steps=14, length=0.1)],
            Gait(swing_height=0.005),
            ground=Ground(platforms=(BLOCK,)),
        )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Gait(step_time=-1.0),
            r"step_time is out of range; got -1.0; wanted a positive.*\[s\]",
        ),
        (lambda: Gait(step_time=0.2, double_support=0.15), "no time to swing"),
        (lambda: Gait(swing_height=float("nan")), "swing_height"),
        (
            lambda: Stride(steps=0),
            "steps is out of range; got 0; wanted a whole number of at least 1, up to 1000",
        ),
        (
            lambda: Stride(steps=2, length=float("inf")),
            r"Stride: length is out of range; got inf.*\[m\]",
        ),
        (
            lambda: Ground.Platform(center=(0.0, 0.0), size=(1.0, -1.0, 0.1)),
            r"Platform: size\[1\] is out of range; got -1.0.*positive.*\[m\]",
        ),
        (
            lambda: Ground.Platform(center=(0.0, float("nan")), size=(1.0, 1.0, 0.1)),
            r"Platform: center\[1\] is out of range; got nan.*\[m\]",
        ),
    ],
)
def test_numbers_that_cannot_be_right_are_refused_when_made(make, message):
    with pytest.raises(ConfigurationError, match=message):
        make()
