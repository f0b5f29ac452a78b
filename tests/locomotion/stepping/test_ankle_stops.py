"""Soles that the ground tilts beyond their ankles' range do not throw the robot about."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pinocchio as pin
import pytest

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.locomotion import ScriptedDevice, StepTeleoperator, WayPoint
from poise.locomotion._stepping._by_torque._departures import AnkleStops
from poise.locomotion._stepping._stance._footing import Footing
from poise.sim import Block
from poise.stack import JointLimit, SurfaceContact

ROLL = "left_ankle_roll_joint"


class Standing:
    """G1 on both soles, the left one tilted, with its ankle's roll at an angle."""

    def __init__(self, robot):
        self.robot, self.limit = robot, JointLimit()
        self.limit.bind(robot)
        self.contacts = [SurfaceContact(sole) for sole in robot.soles]
        for contact in self.contacts:
            contact.bind(robot)
        self.stops = AnkleStops(robot, self.contacts, self.limit)
        self.roll = robot.joint_index(ROLL)
        self.least = float(self.limit.q_min[self.roll])

    def look(self, room, tilt):
        """A tick; whether the lower limit of the ankle holds, and no other is touched."""
        q = self.robot.q_home.copy()
        q[7 + self.roll] = self.least + room
        rotations = pin.rpy.rpyToMatrix(np.array([tilt, 0.0, 0.4])), np.eye(3)
        footing = Mock(spec=Footing)
        footing.dynamics = Mock(q=q)
        footing.soles = [(np.zeros(3), rotation) for rotation in rotations]
        self.stops.update(footing)
        fresh = JointLimit()
        fresh.bind(self.robot)
        others = np.arange(self.robot.nj) != self.roll
        np.testing.assert_array_equal(self.limit.q_min[others], fresh.q_min[others])
        np.testing.assert_array_equal(self.limit.q_max, fresh.q_max)
        return self.limit.q_min[self.roll] == self.least


@pytest.fixture
def standing(get_robot):
    return Standing(get_robot("g1"))


def test_an_ankle_at_its_limit_under_a_tilted_sole_is_left_to_its_stop(standing):
    assert standing.look(0.1, 0.3)
    assert not standing.look(0.0, 0.3)
    assert not standing.look(-0.02, 0.3)
    # Until it has come back, whatever the sole does meanwhile.
    assert not standing.look(0.02, 0.0)
    assert standing.look(0.04, 0.3)
    assert standing.look(0.02, 0.3)


def test_on_level_ground_and_on_slopes_limits_hold(standing):
    for tilt in (0.0, 0.05, 0.09):
        assert standing.look(-0.01, tilt)


def test_a_foot_that_is_lifted_keeps_its_range_again(standing):
    assert not standing.look(0.0, 0.3)
    standing.contacts[0].release(0.0)
    standing.contacts[0].advance(0.0)
    assert standing.look(0.0, 0.3)


def test_all_limits_hold_after_a_reset(standing):
    assert not standing.look(0.0, 0.3)
    standing.stops.reset()
    assert standing.limit.q_min[standing.roll] == standing.least


@pytest.mark.parametrize("outwards", [-0.03, 0.03])
def test_g1_stands_still_with_one_edge_of_a_sole_on_a_ridge(get_robot, outwards):
    """2 cm high, under one half of the right sole, along it: steeper than its ankle rolls.

    Before, it shook, with 50 to 100 N of standard deviation on each foot, and leaned by 0.26 and
    0.64 rad.
    """
    robot = get_robot("g1")
    stride, start = 0.15, StepTeleoperator(robot).estimator.anchors[1]
    ridge = Block(
        center=(float(start[0]) + stride, float(start[1]) - outwards), size=(0.2, 0.03, 0.02)
    )
    places = (
        (0.5, (0.0, 0.0, 0.0)),
        (0.9, (0.0, 0.0, 0.08)),
        (1.6, (stride, 0.0, 0.08)),
        (2.3, (stride, 0.0, -0.03)),
        (2.6, (stride, 0.0, -0.01)),
    )
    points = [WayPoint(at=at, right=place) for at, place in places]
    run = run_teleop(
        robot,
        lambda t: ScriptedDevice(points, *t.estimator.anchors),
        replace(TORQUE_TELEOP_PLANT, blocks=(ridge,)),
        duration=5.0,
        seed=7,
    )
    log = run.log
    assert not run.fell
    still = log.time > 3.5
    assert log.loads[still].min(axis=0).min() > 50.0
    assert log.loads[still].std(axis=0).max() < 15.0
    assert log.tilt[still].max() < 0.05
