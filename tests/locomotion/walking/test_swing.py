"""The trajectory of a foot through the air."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from poise.locomotion import WalkSettings
from poise.locomotion._walking._flight import Flight
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._swing import SwingShape, sinking_phase

DT, T = 0.002, 0.6
BEGIN, GOAL = np.array([0.1, 0.2, 0.0]), Placement(position=(0.4, 0.25, 0.05), yaw=0.3)


def swing(shape=None, rotation=None, depth=0.04, goal=GOAL):
    shape = shape or SwingShape(apex=0.1)
    settings = WalkSettings(touchdown_depth=0.0, search_depth=depth)
    return Flight(0, BEGIN, np.eye(3) if rotation is None else rotation, goal, shape, T, settings)


def flown(foot, seconds=T, shift=lambda _: (0.0, 0.0)):
    rows = []
    for i in range(round(seconds / DT)):
        x, y = shift(i * DT)
        if x or y:
            to_x, to_y, z = GOAL.position
            foot.goal = replace(GOAL, position=(to_x + x, to_y + y, z))
        foot.advance(DT)
        rows.append(
            np.concatenate(
                [foot.position, foot.velocity, foot.acceleration, pin.log3(foot.rotation)]
            )
        )
    return np.array(rows)


def test_a_foot_arrives_at_rest_flat_and_turned():
    foot = swing(rotation=pin.exp3(np.array([0.02, -0.03, 0.1])))
    rows = flown(foot)
    np.testing.assert_allclose(rows[-1, :3], GOAL.position, atol=1e-4)
    # The last tick is the first in which it looks for the ground.
    np.testing.assert_allclose(rows[-2, 3:9], 0.0, atol=2e-3)
    np.testing.assert_allclose(foot.rotation, pin.utils.rotate("z", GOAL.yaw), atol=1e-9)
    assert rows[:, 2].max() == pytest.approx(0.1, abs=1e-4)


def test_a_foot_leaves_with_no_speed_and_no_acceleration():
    rows = flown(swing(), seconds=2 * DT)
    assert np.abs(rows[0, 3:6]).max() < 0.01
    assert np.abs(rows[0, 9:12]).max() < 1.0


def test_rates_are_derivatives():
    rows = flown(swing())
    slope = np.gradient(rows[:, :3], DT, axis=0)[2:-40]
    assert np.abs(slope - rows[2:-40, 3:6]).max() < 0.01
    slope = np.gradient(rows[:, 3:6], DT, axis=0)[2:-40]
    assert np.abs(slope - rows[2:-40, 9:12]).max() < 0.5


def test_a_goal_that_moves_is_reached_without_a_jump():
    rows = flown(swing(), shift=lambda t: (0.1, -0.05) if t > 0.25 else (0.0, 0.0))
    np.testing.assert_allclose(rows[-1, :2], [0.5, 0.2], atol=1e-3)
    assert np.abs(np.diff(rows[:, 3:5], axis=0)).max() < 0.1


def test_a_foot_goes_straight_up_before_it_departs_and_straight_down_after_it_arrives():
    rows = flown(swing(SwingShape(apex=0.1, depart=0.25, arrive=0.75)))
    n = len(rows)
    np.testing.assert_allclose(
        rows[: int(0.24 * n), :2], BEGIN[None, :2] * np.ones((int(0.24 * n), 1))
    )
    np.testing.assert_array_equal(rows[: int(0.24 * n), 3:5], 0.0)
    np.testing.assert_array_equal(rows[: int(0.24 * n), 9:11], 0.0)
    np.testing.assert_allclose(rows[int(0.8 * n) :, 0], GOAL.position[0], atol=2e-3)


def test_the_last_millimetre_goes_by_three_equal_poles():
    """x= -p^3 e - 3 p^2 v - 3 p a has e(t) = e_0 (1 + p t + (p t)^2 / 2) exp(-p t)."""
    foot, pole, dt = swing(SwingShape(apex=0.1, arrive=0.5)), 50.0, 1e-4
    # The time to arrive is over at once, and the foot is still where it was.
    foot.phase = 0.5
    for i in range(1, 1001):
        foot.advance(dt)
        s = pole * i * dt
        left = (1.0 + s + 0.5 * s * s) * math.exp(-s) * (BEGIN[:2] - GOAL.position[:2])
        np.testing.assert_allclose(foot.position[:2] - GOAL.position[:2], left, atol=2e-3)


def test_a_foot_that_finds_no_ground_looks_so_far_down_and_no_farther():
    foot = swing(depth=0.03)
    rows = flown(foot, seconds=T + 1.0)
    assert foot.searching
    assert rows[-1, 2] == pytest.approx(GOAL.position[2] - 0.03)
    assert np.abs(rows[-1, 3:6]).max() < 1e-3
    assert rows[:, 5].min() > -0.6


def test_looking_for_the_ground_begins_when_the_foot_is_due():
    """It speeds up by 8 m/s^2, and goes on at 0.5 m/s."""
    foot = swing(depth=1.0)
    foot.phase = 1.0 - DT / T
    rows = flown(foot, seconds=0.3)
    time = DT * np.arange(1, len(rows) + 1)
    np.testing.assert_allclose(rows[:, 5], -np.minimum(8.0 * time, 0.5), atol=1e-12)
    np.testing.assert_allclose(rows[:, 2], GOAL.position[2] + DT * np.cumsum(rows[:, 5]))
    np.testing.assert_array_equal(rows[:, 11], np.where(8.0 * (time - DT) < 0.5, -8.0, 0.0))


def test_a_foot_that_is_late_looks_for_the_ground_from_where_it_is_as_fast_as_it_is():
    foot = swing(depth=1.0)
    before = flown(foot, seconds=0.5)[-1]
    foot.left = 0.0
    foot.retime()
    rows = flown(foot, seconds=0.1)
    assert before[5] < -0.05
    np.testing.assert_allclose(
        rows[:, 5], np.maximum(before[5] - 8.0 * DT * np.arange(1, 51), -0.5)
    )
    np.testing.assert_allclose(rows[:, 2], before[2] + DT * np.cumsum(rows[:, 5]))


def test_a_foot_comes_down_as_the_ground_lies():
    slope = Placement(position=GOAL.position, yaw=0.3, slope=(0.1, -0.05))
    foot = swing(goal=slope)
    flown(foot)
    normal = np.array([-0.1, 0.05, 1.0])
    np.testing.assert_allclose(foot.rotation[:, 2], normal / np.linalg.norm(normal))
    assert math.atan2(foot.rotation[1, 0], foot.rotation[0, 0]) == pytest.approx(0.3)


class PushedBack(WalkSense):
    """A foot that something ahead of it pushes back, with a tenth of the weight."""

    def __init__(self):
        pass

    def felt(self, foot):
        return -0.1, 0.0, 0.0

    def lower_edge(self, foot):
        return BEGIN + np.array([0.015, 0.0, 0.0]), np.eye(3)


def test_a_foot_that_was_held_goes_straight_up_and_then_on():
    foot = swing()
    flown(foot, seconds=0.1 * T)
    foot.get_clear(PushedBack())
    rows = flown(foot, seconds=(1.0 - foot.phase) * T)
    low = rows[:, 2] < 0.03
    assert low[:10].all()
    apex = int(rows[:, 2].argmax())
    np.testing.assert_allclose(rows[:apex][low[:apex], :2] - BEGIN[:2], 0.0, atol=1e-4)
    np.testing.assert_allclose(rows[-1, :2], GOAL.position[:2], atol=2e-3)


@pytest.mark.parametrize("ground", [0.05, 0.0, -0.1])
def test_a_foot_is_on_the_ground_when_it_is_due_and_aims_below(ground):
    """Whether it steps up or down: on its way to where it aims, it comes by the ground."""
    depth, apex = 0.003, 0.1
    phase = 1.0 - sinking_phase(depth, apex - ground)
    height, _, _ = SwingShape(apex=apex).height(phase, 0.0, ground - depth)
    assert height == pytest.approx(ground, abs=0.3 * depth)


def test_a_foot_that_aims_at_the_ground_itself_sinks_no_moment():
    assert sinking_phase(0.0, 0.1) == sinking_phase(0.0, 0.0) == 0.0
