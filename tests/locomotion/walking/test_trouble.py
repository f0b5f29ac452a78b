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


def test_a_foot_is_on_its_way_until_it_is_near_its_foothold_or_due(held):
    foot = held.swing(ahead=0.3)
    flight = held.walker._engine.steps.flight
    sense = held.walker._engine.parts.sense
    assert flight.on_its_way(sense)
    begin = held.q[0]
    for left, nearer, on_its_way in ((0.3, 0.2, True), (0.3, 0.25, False), (0.02, 0.0, False)):
        flight.left = left
        held.q[0] = begin + nearer
        sense.update(poise.RobotState(held.q, held.v, {}, held.time))
        way = flight.goal.position[0] - sense.lower_edge(foot)[0][0]
        assert way == pytest.approx(0.3 - nearer, abs=0.01)
        assert flight.on_its_way(sense) is on_its_way


@pytest.mark.parametrize("on_its_way", [True, False])
def test_what_a_foot_meets_on_its_way_is_not_its_ground(held, monkeypatch, on_its_way):
    held.swing()
    flight = held.walker._engine.steps.flight
    held.until(held.time + 0.51 * held.walker.gait.swing_time)
    monkeypatch.setattr(type(flight), "on_its_way", lambda *_: on_its_way)
    held.loads = [0.5, 0.5]
    held.until(held.time + 2 * DT)
    assert held.walker._engine.steps.flight is (flight if on_its_way else None)
    assert held.walker.steps_made == (0 if on_its_way else 1)


def test_a_foot_that_meets_something_before_it_could_be_down_carries_at_once(held):
    """Its capture step begins half a metre up: until it is down it counts as not yet lifted."""
    robot = held.robot
    for joint, angle in (("left_hip_pitch", -1.2), ("left_knee", 1.9), ("left_ankle_pitch", -0.7)):
        held.q[7 + robot.joint_index(joint)] += angle
    held.until(0.01)
    held.loads = [0.0, 1.0]
    held.walker._engine.steps.put_down(0)
    held.until(held.time + DT)
    flight = held.walker._engine.steps.flight
    assert flight.elapsed < 0.0
    held.walker._engine.steps._land(flight)
    assert held.active() == [True, True]


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


@pytest.mark.parametrize("idle", [0.06, 1.0])
def test_a_foot_that_carries_again_does_not_hang(held, idle):
    watch, sense = held.walker._engine._hang_watch, held.walker._engine.parts.sense

    def carry(left, right, time):
        for _ in range(round(time / DT)):
            loads = zip(held.robot.soles, (left, right), strict=True)
            wrenches = {s: np.array([0, 0, k * held.robot.weight, 0, 0, 0]) for s, k in loads}
            sense.update(poise.RobotState(held.q, held.v, wrenches, 0.0))
            watch.update(DT)

    carry(0.0, 1.0, idle)
    assert watch.foot == 0
    carry(0.5, 0.5, 0.012)
    assert watch.foot is None


def test_after_a_bounce_the_foothold_is_still_where_it_was_asked_for(held):
    foot = held.swing(ahead=0.05)
    asked = held.walker.commands.footholds[0]
    held.land()
    assert not held.walker.commands.footholds
    held.loads = [0.0, 1.0] if foot == 0 else [1.0, 0.0]
    held.until(held.time + held.walker.settings.bounce_time + 4 * DT)
    assert held.walker._engine.steps.flight is not None
    assert [*held.walker.commands.footholds] == [asked]


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


def test_one_given_while_a_foot_that_bounced_off_seemed_to_stand_is_its_next_step(held):
    held.walker.set_velocity(0.3)
    held.lift()
    held.land()
    held.walker.step_to(*LATER[0])
    given = [*held.walker.commands.footholds]
    held.loads = [0.0, 1.0]
    held.until(held.time + held.walker.settings.bounce_time + 4 * DT)
    assert held.walker._engine.steps.flight is not None
    held.land()
    assert [*held.walker.commands.footholds] == given


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


def test_who_begins_another_run_knows_of_no_slope(held):
    held.walker._engine.parts.stance.slope, held.walker._engine.steps.steps_made = (0.1, 0.05), 7
    held.walker._engine.reset()
    assert held.walker._engine.parts.stance.slope == (0.0, 0.0)
    assert held.walker.steps_made == 0


class Huge(float):
    """As a whole number of 400 digits, which is no float for who checks types here."""

    def __float__(self):
        return float(10**400)


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


def test_numbers_that_no_float_holds_are_ignored_and_said(held):
    held.walker.set_velocity(0.2)
    held.until(1.2)
    held.walker.set_velocity(Huge(), 0.0, Huge())
    assert "not finite" in held.walker.notice
    held.until(held.time + DT)
    assert held.walker.commands.velocity == pytest.approx((0.2, 0.0, 0.0))
    held.walker.step_to("left_sole", 0.2, Huge(), 0.0)
    assert held.walker.notice == "foothold ignored: not finite"
    assert not held.walker.commands.footholds


def test_a_carried_target_that_is_no_number_is_refused_and_stops_nobody(held):
    carried = held.walker.carried
    name, target = next(iter(carried.items()))
    before = target.target_position.copy()
    with pytest.raises(poise.errors.TargetError, match="carried task"):
        target.set_target(np.array([np.nan, 0.0, 1.0]), velocity=np.zeros(6))
    np.testing.assert_array_equal(target.target_position, before)
    held.until(0.02)
    assert name in carried
