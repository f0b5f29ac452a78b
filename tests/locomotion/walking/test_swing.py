"""The trajectory of a foot through the air."""

import math

import numpy as np
import pinocchio as pin
import pytest

from poise.errors import ConfigurationError
from poise.locomotion._walking._footsteps import Placement, SwingShape
from poise.locomotion._walking._swing import SwingFoot

DT, T = 0.002, 0.6
BEGIN, GOAL = np.array([0.1, 0.2, 0.0]), Placement(position=(0.4, 0.25, 0.05), yaw=0.3)


def swing(shape=None, rotation=None, depth=0.04):
    shape = shape or SwingShape(apex=0.1)
    return SwingFoot(BEGIN, np.eye(3) if rotation is None else rotation, GOAL, shape, T, depth)


def flown(foot, seconds=T, shift=lambda _: np.zeros(2)):
    rows = []
    for i in range(round(seconds / DT)):
        foot.advance(DT, shift(i * DT))
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
    np.testing.assert_allclose(rows[-1, 3:9], 0.0, atol=4e-3)
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
    rows = flown(swing(), shift=lambda t: (t > 0.25) * np.array([0.1, -0.05]))
    np.testing.assert_allclose(rows[-1, :2], [0.5, 0.2], atol=1e-3)
    assert np.abs(np.diff(rows[:, 3:5], axis=0)).max() < 0.1


def test_a_foot_goes_straight_up_before_it_departs_and_straight_down_after_it_arrives():
    rows = flown(swing(SwingShape(apex=0.1, depart=0.25, arrive=0.75)))
    n = len(rows)
    np.testing.assert_allclose(
        rows[: int(0.24 * n), :2], BEGIN[None, :2] * np.ones((int(0.24 * n), 1))
    )
    np.testing.assert_allclose(rows[int(0.8 * n) :, 0], GOAL.position[0], atol=2e-3)


def test_a_foot_that_finds_no_ground_looks_so_far_down_and_no_farther():
    foot = swing(depth=0.03)
    rows = flown(foot, seconds=T + 1.0)
    assert foot.exhausted
    assert rows[-1, 2] == pytest.approx(GOAL.position[2] - 0.03)
    assert np.abs(rows[-1, 3:6]).max() < 1e-3
    assert rows[:, 5].min() > -0.6


def test_a_foot_that_is_stopped_comes_straight_down():
    foot = swing()
    rows = flown(foot, seconds=0.3)
    foot.stop_here()
    after = flown(foot, seconds=1.0)
    np.testing.assert_allclose(after[-1, :2], rows[-1, :2], atol=1e-9)
    assert after[-1, 2] < GOAL.position[2]


@pytest.mark.parametrize(
    "values",
    [{"apex": math.nan}, {"apex": 0.1, "depart": 0.95}, {"apex": 0.1, "arrive": 1.2}],
)
def test_a_shape_that_is_none_is_refused(values):
    with pytest.raises(ConfigurationError):
        SwingShape(**values)
