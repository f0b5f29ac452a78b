"""What the walker does about trouble; states are made up, nothing is simulated."""

from dataclasses import replace

import numpy as np
import pytest

import poise
from poise.locomotion import Walker, WalkSettings, walking_stack
from poise.locomotion._walking._settings import WalkStatus
from poise.locomotion._walking._trouble import RESPONSES

DT = 0.002


class Held:
    """A robot that stays where it is put, whatever its walker asks for."""

    def __init__(self, robot, settings=None):
        self.robot, self.stack = robot, walking_stack(robot)
        self.walker = Walker(robot, self.stack, settings=settings)
        self.q, self.v, self.time = robot.q_home.copy(), np.zeros(robot.nv), 0.0
        self.loads = [0.5, 0.5]
        self.side = 0.0
        """Force back on the left sole [N]."""

    def until(self, time):
        """Goes on; all that was said of it on the way."""
        said = []
        while self.time < time:
            wrenches = [np.array([0, 0, k * self.robot.weight, 0, 0, 0]) for k in self.loads]
            wrenches[0][0] = -self.side
            contacts = dict(zip(self.robot.soles, wrenches, strict=True))
            self.walker.lead(poise.RobotState(self.q, self.v, contacts, self.time))
            for contact in self.stack.contacts:
                contact.advance(self.time)
            self.time += DT
            said.append(self.walker.status)
        return said

    def active(self):
        return [contact.active for contact in self.stack.contacts]

    def land(self):
        """Goes on until the foot in the air carries."""
        self.until(self.time + 0.6 * self.walker.gait.swing_time)
        self.loads = [0.5, 0.5]
        while self.walker._engine.steps.flight is not None:
            self.until(self.time + DT)

    def swing(self, ahead=0.0):
        """Lifts the left foot, the weight being on its way to the right one."""
        x, y, _ = self.walker._engine.parts.stance.feet[0].position
        self.walker.step_to("left_sole", x + ahead, y, 0.0)
        return self.lift()

    def lift(self):
        """Goes on until a foot is in the air."""
        self.v[1] = -0.3
        while self.walker._engine.steps.flight is None:
            self.until(self.time + DT)
            assert self.time < 5.0
        self.v[1] = 0.0
        foot = self.walker._engine.steps.flight.foot
        self.loads = [0.0, 1.0] if foot == 0 else [1.0, 0.0]
        return foot


@pytest.fixture
def held(get_robot):
    return Held(get_robot("humanoid33"))


def test_every_trouble_that_a_led_walk_can_have_has_a_response():
    troubles = {status for status in WalkStatus if not status.ok}
    assert troubles - {WalkStatus.MISPLACED} == set(RESPONSES)


def test_a_robot_that_is_lifted_stops_hangs_with_its_targets_and_begins_anew(held):
    held.walker.set_velocity(0.3)
    held.until(0.1)
    held.loads = [0.0, 0.0]
    assert held.until(0.2)[-1] is not WalkStatus.LIFTED
    assert held.until(0.4)[-1] is WalkStatus.LIFTED
    assert held.active() == [False, False]
    foot = held.stack.task("left_foot")
    before = foot.target_position.copy()
    held.q[:3] += (0.1, 0.0, 0.5)
    held.until(0.6)
    np.testing.assert_allclose(foot.target_position - before, (0.1, 0.0, 0.5), atol=1e-9)
    assert held.walker.steps_made == 0
    held.loads = [0.5, 0.5]
    assert held.until(0.8)[-1] is WalkStatus.STANDING
    assert held.active() == [True, True]


def test_a_robot_that_lies_has_fallen_and_lifts_no_foot(held):
    held.walker.set_velocity(0.3)
    held.until(0.1)
    held.q[3:7] = (np.sin(0.75), 0.0, 0.0, np.cos(0.75))
    assert held.until(2.0)[-1] is WalkStatus.FALLEN
    assert held.walker.steps_made == 0
    assert held.walker._engine.steps.flight is None


def test_a_foot_that_is_held_by_something_comes_straight_down(held):
    foot = held.swing(ahead=0.2)
    place = held.walker._engine.parts.sense.sole(foot)[0].copy()
    assert WalkStatus.FOOT_CAUGHT not in held.until(held.time + 0.3)
    held.loads = [0.03, 0.97]
    assert WalkStatus.FOOT_CAUGHT in held.until(held.time + 0.5)
    # It was up and on its way ahead; from there it goes down, and no farther.
    caught = held.walker._engine.steps.flight
    assert np.linalg.norm(caught.position[:2] - place[:2]) < 0.25
    assert caught.searching


def test_a_foot_that_finds_nothing_waits_and_the_walk_with_it(held):
    held.swing()
    said = held.until(held.time + 2.0)
    assert said[-1] is WalkStatus.FOOT_LOST
    flight = held.walker._engine.steps.flight
    lowest = flight.end - held.walker.settings.search_depth
    assert flight.position[2] == pytest.approx(lowest, abs=1e-9)
    assert held.walker.commands.pace == 0.0
    held.loads = [0.5, 0.5]
    assert held.until(held.time + 2 * DT)[-1] is not WalkStatus.FOOT_LOST
    assert held.walker.steps_made == 1


def test_a_sole_that_slips_halves_the_pace_for_a_while(held):
    held.walker.set_velocity(0.3)
    held.until(0.1)
    held.v[0] = 0.25
    assert WalkStatus.SLIPPING not in held.until(0.14)
    assert WalkStatus.SLIPPING in held.until(0.2)
    assert held.walker.commands.pace == 0.5
    held.v[0] = 0.0
    held.until(1.5)
    assert held.walker.commands.pace == 1.0


@pytest.mark.parametrize("bounce_time", [0.01, 0.03])
def test_a_foot_that_has_bounced_off_looks_for_the_ground_again(get_robot, bounce_time):
    held = Held(get_robot("humanoid33"), WalkSettings(bounce_time=bounce_time))
    foot = held.swing()
    flight = held.walker._engine.steps.flight
    held.land()
    assert held.walker.steps_made == 1
    held.loads = [0.0, 1.0] if foot == 0 else [1.0, 0.0]
    # What has just come down may carry nothing for a moment.
    held.until(held.time + bounce_time - 2 * DT)
    assert held.walker._engine.steps.flight is None
    held.until(held.time + 4 * DT)
    assert held.walker._engine.steps.flight is flight
    assert held.walker.steps_made == 0
    assert flight.searching
    assert held.active() == [foot == 1, foot == 0]


@pytest.mark.parametrize("foot", [0, 1])
def test_a_foot_that_stands_and_hangs_is_one_in_the_air(held, foot):
    """What its contact is asked to carry would move nothing but its leg."""
    held.until(0.5)
    held.loads = [0.0, 1.0] if foot == 0 else [1.0, 0.0]
    held.until(0.54)
    assert held.walker.lifting is None
    held.until(0.57)
    assert held.walker.lifting == (foot, True)
    assert held.active() == [foot == 1, foot == 0]
    # It comes down where it is, and both stand again.
    held.until(held.time + 0.5 * held.walker.gait.swing_time)
    held.loads = [0.5, 0.5]
    held.until(held.time + 0.1)
    assert held.active() == [True, True]
    assert held.walker._engine.at_rest


def test_a_foot_that_carries_little_does_not_hang(held):
    held.loads = [0.02, 0.98]
    held.until(0.8)
    assert held.walker.lifting is None
    assert held.walker.steps_made == 0


def test_a_foot_that_is_held_on_its_way_up_goes_back_and_straight_up(held):
    foot = held.swing(ahead=0.2)
    assert foot == 0
    stood, swing = (
        held.walker._engine.parts.sense.sole(0)[0].copy(),
        held.walker._engine.steps.flight,
    )
    held.side = 0.1 * held.robot.weight
    held.until(held.time + 10 * DT)
    np.testing.assert_allclose(swing.position[:2] - stood[:2], (-0.015, 0.0), atol=1e-3)
    held.side = 0.0
    height = swing.position[2]
    while swing.phase < 0.3:
        held.until(held.time + DT)
        if swing.position[2] - stood[2] < 0.025:
            assert swing.position[0] < stood[0] - 0.01
    assert swing.position[2] > height
    while swing.phase < 0.7:
        held.until(held.time + DT)
    assert swing.position[0] > stood[0] + 0.05


LATER = [("left_sole", 0.3, 0.15, 0.2), ("right_sole", 0.3, -0.1, 0.0)]


def test_a_foothold_given_for_the_foot_in_the_air_is_its_next_step(held):
    """The one under way would be too late for it, and is turned otherwise."""
    held.walker.set_velocity(0.3)
    foot, walker = held.lift(), held.walker
    going_to = walker.landing
    for step in LATER:
        walker.step_to(*step)
    given = [*walker.commands.footholds]
    held.until(held.time + DT)
    assert walker.landing.yaw == going_to.yaw
    # The foot and the robot stay where they are: it moves only to catch that.
    assert walker.landing.position == pytest.approx(going_to.position, abs=2.1 * DT)
    held.land()
    assert (walker.steps_made, foot) == (1, 0)
    assert [*walker.commands.footholds] == given
    assert held.lift() == 0
    assert walker.landing.yaw == pytest.approx(0.2)
    assert walker.notice == ""


def test_a_foot_that_is_caught_costs_no_command(held):
    held.until(0.1)
    held.walker.set_velocity(0.3, 0.0, 0.0)
    held.walker.step_to("right_sole", 0.1, -0.1, 0.0)
    held.walker.set_velocity(0.3, 0.0, 0.0)
    held.walker._engine.steps.catch(0)
    assert [hold.foot for hold in held.walker.commands.footholds] == [0, 1]
    assert held.walker.commands.moving
    held.walker.commands.footholds.clear()
    assert held.walker.commands.moving
    assert held.walker.commands.closes


@pytest.mark.parametrize("time", [np.nan, 10**400], ids=["nan", "huge"])
def test_a_clock_that_is_no_number_is_passed_over(get_robot, time):
    robot, velocities = get_robot("humanoid33"), []
    state = poise.RobotState(robot.q_home, np.zeros(robot.nv))
    broken = replace(state)
    object.__setattr__(broken, "time", time)
    for bad in ([], [broken, broken]):
        walker = Walker(robot, walking_stack(robot))
        for told in bad:
            walker.lead(told)
            assert walker.status is WalkStatus.READY
        walker.set_velocity(0.3)
        for told in (state, *bad, replace(state, time=0.002), *bad, replace(state, time=0.004)):
            walker.lead(told)
            assert walker.status.ok
        velocities.append(walker.commands.velocity)
    assert velocities[0] == velocities[1]
    assert velocities[0][0] > 0.0
