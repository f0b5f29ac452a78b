"""The trajectory of a foot through the air."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from poise.locomotion import WalkSettings
from poise.locomotion._walking._flight import Flight
from poise.locomotion._walking._ground import Placement, SwingShape, sinking_phase
from poise.locomotion._walking._sense import WalkSense

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


def test_a_foot_that_finds_no_ground_looks_so_far_down_and_no_farther():
    foot = swing(depth=0.03)
    rows = flown(foot, seconds=T + 1.0)
    assert foot.searching
    assert rows[-1, 2] == pytest.approx(GOAL.position[2] - 0.03)
    assert np.abs(rows[-1, 3:6]).max() < 1e-3
    assert rows[:, 5].min() > -0.6


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


class PushedBack(WalkSense):
    """A foot that something ahead of it pushes back, with a tenth of the weight."""

    def __init__(self):
        pass

    def relative_force(self, foot):
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
