"""What of a sole carries, learned from how it turns; states are made up, nothing is simulated."""

import numpy as np
import pytest

import poise
from poise.locomotion import walking_stack
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._stance import CarryingArea, Stance
from poise.locomotion._walking._step_planner import Lifted

DT = 0.002
LEFT = "left_sole"


class Turned:
    """A sole that turns, because its robot does, about what it stands on."""

    def __init__(self, robot):
        self.robot, stack = robot, walking_stack(robot)
        stack.bind(robot)
        self.contact = next(c for c in stack.contacts if c.frame == LEFT)
        self.sense = WalkSense(robot, ("left_sole", "right_sole"))
        self.area = CarryingArea(self.sense, 0, self.contact)
        self.whole = self.contact.cone.copy()

    def look(self, pressure=(0.0, 0.0), turning=(0.0, 0.0), load=0.5, ticks=1, settled=False):
        """Some ticks with the pressure there and the sole turning like that."""
        force = load * self.robot.weight
        wrench = np.array([0.0, 0.0, force, pressure[1] * force, -pressure[0] * force, 0.0])
        v = np.zeros(self.robot.nv)
        v[3:5] = turning
        for _ in range(ticks):
            state = poise.RobotState(self.robot.q_home, v, {LEFT: wrench}, 0.0)
            self.sense.update(state)
            self.area.update(DT, settled=settled)

    def bears(self, x, y):
        """Whether pressure may be asked for there."""
        return (self.contact.cone @ np.array([0.0, 0.0, 1.0, y, -x, 0.0])).max() < 1e-9


@pytest.fixture
def turned(get_robot):
    return Turned(get_robot("humanoid33"))


@pytest.mark.parametrize(
    ("turning", "carries", "bare"),
    [
        ((0.0, 1.0), (-0.02, 0.0), (0.05, 0.0)),
        ((0.0, -1.0), (0.05, 0.0), (-0.03, 0.0)),
        ((1.0, 0.0), (0.01, 0.02), (0.01, -0.01)),
        ((-1.0, 0.0), (0.01, -0.02), (0.01, 0.02)),
    ],
)
def test_the_side_that_goes_down_carries_nothing(turned, turning, carries, bare):
    turned.look(pressure=(0.01, 0.0), turning=turning)
    assert turned.bears(*carries)
    assert not turned.bears(*bare)


def test_a_sole_that_lies_still_carries_everywhere(turned):
    turned.look(pressure=(0.05, 0.02), ticks=50)
    np.testing.assert_array_equal(turned.contact.cone, turned.whole)
    assert turned.area.lies


def test_the_area_grows_again_and_at_once_to_where_pressure_is_felt(turned):
    turned.look(pressure=(0.0, 0.0), turning=(1.0, 1.0), ticks=5)
    turned.look(pressure=(0.0, 0.0), turning=(-1.0, -1.0), ticks=5)
    assert not turned.area.lies
    turned.look(pressure=(0.06, -0.02))
    assert turned.bears(0.06, -0.02)
    turned.look(ticks=round(1.0 / DT))
    np.testing.assert_allclose(turned.contact.cone, turned.whole, atol=1e-12)


def test_while_feet_are_held_the_contact_has_the_average(turned):
    turned.look(pressure=(0.01, 0.0), turning=(0.0, 1.0))
    assert not turned.bears(0.05, 0.0)
    # A sole that rocks for a moment takes hardly anything away ...
    turned.look(settled=True, ticks=round(1.0 / DT))
    turned.look(pressure=(0.01, 0.0), turning=(0.0, 1.0), settled=True)
    assert turned.bears(0.11, 0.0)
    # ... one that goes on turning does.
    turned.look(pressure=(0.01, 0.0), turning=(0.0, 1.0), settled=True, ticks=round(1.0 / DT))
    assert turned.bears(0.01, 0.0)
    assert not turned.bears(0.02, 0.0)
    assert turned.area.part((0.26, 0.14)) is not None
    turned.look(settled=True, ticks=round(2.0 / DT))
    np.testing.assert_allclose(turned.contact.cone, turned.whole, atol=1e-12)


def test_steps_are_chosen_by_what_carries_of_the_foot_that_stands(get_robot):
    robot = get_robot("humanoid33")
    walker = poise.locomotion.Walker(robot, walking_stack(robot))
    stand = walker._engine.parts.stand
    lifted = Lifted(
        0, stand.start[0].position[:2], stand.start[1], stand.bearings[1], (0.03, -0.05)
    )
    heel = lifted._replace(bearing=stand.bearings[1].within((-0.1, -1.0), (-0.06, 1.0)))
    sole, edge = (walker._engine.parts.planner.plan(foot) for foot in (lifted, heel))
    assert heel.zmp[0] == pytest.approx(lifted.zmp[0] - 0.076, abs=2e-3)
    assert edge.room[0] < 0.2 * sole.room[0]
    assert edge.room[1] == sole.room[1]
    # The CoM tips over the edge sooner than over the middle: the foot goes farther, or is sooner.
    (whole, _), (part, _) = (
        walker._engine.parts.planner.choose(foot, plan, 0.0)
        for foot, plan in ((lifted, sole), (heel, edge))
    )
    assert part.x > whole.x + 0.03


def test_two_feet_hold_no_more_than_what_carries_of_them(turned):
    robot = turned.robot
    stand = poise.locomotion.Walker(robot, walking_stack(robot))._engine.parts.stand
    right = CarryingArea(turned.sense, 1, turned.contact)
    stance = Stance(turned.sense, stand, 0.01, [turned.area, right])
    turned.look()
    stance.stand_on((0, 1), 0.0)
    x, y, _ = stance.feet[0].position
    ahead = (x + 0.08, y)
    whole = stance.support.depth(ahead)
    assert whole > 0.0
    # The toes of the left foot go down.
    turned.look(pressure=(0.02, 0.0), turning=(0.0, 1.0), ticks=round(1.0 / DT))
    stance.refresh()
    assert stance.support.depth(ahead) < -0.02
    assert stance.support.depth((x - 0.02, y - 0.05)) > 0.0
    turned.look(ticks=round(2.0 / DT))
    stance.refresh()
    assert stance.support.depth(ahead) == pytest.approx(whole)


def test_a_sole_on_an_edge_says_nothing_of_the_slope(turned):
    robot = turned.robot
    stand = poise.locomotion.Walker(robot, walking_stack(robot))._engine.parts.stand
    stance = Stance(turned.sense, stand, 0.01, [turned.area, turned.area])
    q = robot.q_home.copy()
    q[3:7] = 0.0, np.sin(0.05), 0.0, np.cos(0.05)
    tilted = poise.RobotState(q, np.zeros(robot.nv))
    turned.look(turning=(0.0, 1.0), pressure=(-0.1, 0.0))
    turned.look(turning=(0.0, -1.0), pressure=(-0.1, 0.0))
    turned.sense.update(tilted)
    stance.stand_on((0,), 0.0)
    assert stance.slope == (0.0, 0.0)
    turned.look(ticks=round(1.0 / DT))
    turned.sense.update(tilted)
    stance.stand_on((0,), 0.0)
    assert stance.slope[0] == pytest.approx(-0.5 * np.tan(0.1))
