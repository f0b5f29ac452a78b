"""The stance foot, the ground under each sole, and what becomes of a foot that carries nothing."""

import math

import numpy as np
import pytest

from poise.dynamics import RobotState
from poise.locomotion import StepTeleoperator

TICKS = 400
"""Long enough for a foot to be as far down as it is pressed, and to learn the ground."""


class Stands:
    """A biped that stands still, where velocities are commanded: loads and pressures by hand."""

    def __init__(self, robot):
        self.robot, self.teleoperator = robot, StepTeleoperator(robot, actuation="velocity")
        self.time = 0.0

    def tick(self, left, right, *, points=((0.0, 0.0), (0.0, 0.0)), pitch=0.0, count=1):
        """Ticks with loads on the soles [N] at points of theirs [m], nose down by a pitch [rad]."""
        contacts = {
            sole: np.array([0.0, 0.0, load, y * load, -x * load, 0.0])
            for sole, load, (x, y) in zip(
                self.teleoperator.soles, (left, right), points, strict=True
            )
        }
        q = self.robot.q_home.copy()
        q[3:7] = 0.0, math.sin(0.5 * pitch), 0.0, math.cos(0.5 * pitch)
        for _ in range(count):
            self.time += self.teleoperator.dt
            measured = RobotState(q, np.zeros(self.robot.nv), contacts, self.time)
            self.teleoperator.lead(self.teleoperator.estimator.update(measured))
        return self.teleoperator.estimator

    def turn(self, foot):
        """Commanded pitch rate of a sole [rad/s]."""
        name = f"{self.teleoperator.soles[foot]} level"
        return float(self.teleoperator.stack.task(name).given_velocity[1])


@pytest.fixture
def stands(get_robot):
    return Stands(get_robot("biped20"))


def test_the_foot_that_carries_more_is_the_stance(stands):
    before = stands.tick(320.0, 320.0).stance
    loads = (300.0, 320.0) if before == 0 else (320.0, 300.0)
    assert stands.tick(*loads).stance == before
    for left, right, stance in ((500.0, 100.0, 0), (100.0, 500.0, 1)):
        assert stands.tick(left, right).stance == stance


def test_a_foot_that_carries_nothing_is_pressed_down_until_it_stands(stands):
    dt = stands.teleoperator.dt
    ours = stands.tick(0.0, 640.0)
    assert ours.pressed == pytest.approx(dt * 0.15)
    stands.tick(0.0, 640.0, count=TICKS)
    # How far below itself it is sent, times the gain (17c), is the speed of the foot.
    assert 10.0 * ours.pressed == pytest.approx(0.15)
    # The ground is where the foot is: the body does not come down with what is pressed.
    height = float(ours.sole(0)[2])
    assert ours.anchors[0][2] == pytest.approx(height, abs=1e-9)
    stands.tick(40.0, 600.0)
    assert ours.pressed == 0.0
    assert ours.anchors[0][2] == pytest.approx(height, abs=1e-9)


def test_a_sole_that_lies_flat_is_on_ground_as_it_lies(stands):
    """So an inertial unit that is off turns no sole."""
    stands.tick(360.0, 280.0, points=((0.01, 0.0), (0.01, 0.0)), pitch=0.02, count=TICKS)
    assert stands.turn(1) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("toe", [-0.149, 0.149])
def test_a_sole_that_has_not_lain_flat_yet_turns_its_free_edge_down(stands, toe):
    stands.tick(360.0, 280.0, points=((0.0, 0.0), (toe, 0.0)), count=2)
    # By 0.5 rad/s, and by 0.3 rad/s per metre to where the stance is pressed.
    share = 2.0 * 280.0 / stands.robot.weight
    assert stands.turn(1) == pytest.approx(-math.copysign(0.5, toe) - 0.3 * share * toe, rel=1e-3)
    stands.tick(360.0, 280.0, count=2)
    stands.tick(360.0, 280.0, points=((0.0, 0.0), (toe, 0.0)))
    assert abs(stands.turn(1)) < 0.1


def test_the_zmp_is_where_the_soles_are_pressed(stands):
    points, loads = ((0.05, 0.01), (-0.02, 0.0)), (480.0, 160.0)
    ours = stands.tick(*loads, points=points, count=20)
    soles = [ours.sole(foot)[:2] + points[foot] for foot in (0, 1)]
    zmp = stands.teleoperator.status.zmp
    np.testing.assert_allclose(zmp, 0.75 * soles[0] + 0.25 * soles[1], atol=1e-6)
    np.testing.assert_allclose(stands.teleoperator.status.loads, loads, atol=1e-9)
    # Without load, or with a hole in a wrench, the last one holds.
    for left in (0.0, np.nan):
        stands.tick(left, 0.0)
        np.testing.assert_allclose(stands.teleoperator.status.zmp, zmp, atol=1e-12)
