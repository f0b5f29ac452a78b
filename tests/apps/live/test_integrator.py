"""From held keys, sticks and handles to places of feet and hands, and to the body."""

from unittest.mock import Mock

import numpy as np
import pinocchio as pin
import pytest
from msgspec.structs import replace

pytest.importorskip("websockets")

from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._integrator import HOLD_HEIGHT, BodyLimits, Integrator, LiveFeet
from poise.locomotion import (
    BodyCommand,
    Mode,
    OperatorSample,
    StepTeleoperator,
    TrackedPose,
)
from poise.locomotion._stepping import FOOT_TURNS, TORSO_MOST

DT = 0.005
REST = OperatorSample()


class Led:
    """A device of a person, and the robot at its start."""

    def __init__(self, robot, actuation="velocity"):
        self.operator = OperatorInputs()
        self.teleoperator = StepTeleoperator(robot, actuation=actuation)
        self.device = LiveFeet(self.operator, self.teleoperator)
        self.anchors = [anchor.copy() for anchor in self.teleoperator.estimator.anchors]

    def run(self, ticks, pad):
        for tick in range(ticks):
            self.operator.take(pad)
            sample = self.device.sample(tick * DT)
        return sample

    def way(self, foot, ticks, pad):
        """Way of a foot from where it stands."""
        return np.array(self.run(ticks, pad).place(foot)) - self.anchors[foot]


@pytest.fixture
def led(get_robot):
    return Led(get_robot("biped20"))


def test_devices_are_on_the_feet_and_a_button_lifts_its_foot_until_nobody_is_there(led):
    assert led.device.sample(0.0) is None
    for foot in (0, 1):
        np.testing.assert_allclose(led.way(foot, 10, REST), 0.0, atol=1e-12)
    held = OperatorSample(lift=(False, True))
    np.testing.assert_allclose(led.way(1, 100, held), [0.0, 0.0, HOLD_HEIGHT], atol=1e-12)
    np.testing.assert_allclose(led.way(0, 1, held), 0.0, atol=1e-12)
    led.operator.clear()
    assert led.device.sample(1.0) is None
    np.testing.assert_allclose(led.device.places, led.anchors, atol=1e-12)


def test_a_mouse_that_jumps_moves_the_device_smoothly_to_where_it_is_drawn(led):
    way, offset = np.array([0.3, 0.1, 0.2]), np.array([0.5, 0.0, 0.0])
    led.device.offset = offset
    led.run(1, REST)
    held = OperatorSample(feet=(TrackedPose(tuple(led.anchors[0] + way + offset)), None))
    before = np.zeros(3)
    for _ in range(200):
        now = led.way(0, 1, held)
        assert np.linalg.norm(now - before) <= 0.6 * DT + 1e-12
        # Straight towards it.
        assert np.linalg.norm(np.cross(now - before, way - before)) < 1e-12
        before = now
    np.testing.assert_allclose(before, way, atol=1e-12)


def test_a_handle_that_was_far_away_is_back_within_a_second(led):
    led.run(1, REST)
    foot = led.anchors[1]

    def way(ticks, *place):
        return led.way(1, ticks, OperatorSample(feet=(None, TrackedPose(place))))

    # Straight away from the foot, at the height at which it is held.
    np.testing.assert_allclose(
        way(400, 3e4, -4e4, foot[2] + 0.32), [0.144, -0.192, 0.32], atol=1e-5
    )
    assert np.linalg.norm(way(400, 999.0, -999.0, 999.0)) == pytest.approx(0.4)
    np.testing.assert_allclose(way(200, *foot), 0.0, atol=1e-12)


@pytest.mark.parametrize("mode", [Mode.SL, Mode.SR])
@pytest.mark.parametrize("both", [False, True])
def test_with_one_foot_held_either_stick_moves_it_and_with_both_its_own(led, mode, both):
    led.teleoperator._level = Mock(mode=mode, footing=None)
    foot = 1 - mode.support
    start = led.device.places[foot][0]
    lift = (True, True) if both else (foot == 0, foot == 1)
    for stick, own in (("move", foot == 0), ("second", foot == 1)):
        led.device.places[foot][0] = start
        led.run(20, OperatorSample(lift=lift, **{stick: (1.0, 0.0)}))
        moved = bool(led.device.places[foot][0] > start + 0.02)
        assert moved is (own or not both)


# Trackers --------------------------------------------------------------------------------------


def tracked(x, z, *, clutch=True, **more):
    """The left foot as a tracker sees it, from a place of its own."""
    return OperatorSample(feet=(TrackedPose((7.0 + x, -3.0, 1.2 + z), clutch, **more), None))


def test_a_tracked_foot_leads_by_what_it_moves_while_its_clutch_is_closed(led):
    led.run(5, tracked(0.0, 0.0, clutch=False))
    np.testing.assert_allclose(led.way(0, 5, tracked(0.0, 0.0)), 0.0, atol=1e-12)
    np.testing.assert_allclose(led.way(0, 40, tracked(0.1, 0.05)), [0.1, 0.0, 0.05], atol=1e-12)
    # Let go, moved back and taken hold of anew: further ahead than the hand ever was.
    for x in (0.1, 0.0):
        led.operator.take(replace(tracked(x, 0.05, clutch=False), lift=(True, False)))
        led.device.sample(0.0)
    place = led.device.places[0] - led.anchors[0]
    led.run(1, tracked(0.0, 0.05))
    moved = led.way(0, 40, tracked(0.1, 0.05)) - place
    np.testing.assert_allclose(moved, [0.1, 0.0, 0.0], atol=5e-3)


@pytest.mark.parametrize("lead", ["stick", "tracker"])
def test_forward_is_where_the_robot_faces(led, lead):
    # It has been turned by a quarter to the left.
    led.teleoperator._ahead = np.pi / 2.0
    if lead == "stick":
        led.teleoperator._level = Mock(mode=Mode.SR, footing=None)
        aside, forward, _ = led.way(0, 20, OperatorSample(lift=(True, False), move=(1.0, 0.0)))
    else:
        led.run(2, tracked(0.0, 0.0, clutch=False))
        led.run(2, tracked(0.0, 0.0))
        fast = tracked(0.05, 0.02, velocity=(0.2, 0.0, 0.1))
        aside, forward, _ = led.way(0, 40, fast)
        # It says how fast the foot is, too; one that is let go does not go.
        sample = led.run(1, fast)
        np.testing.assert_allclose(sample.feet[0].velocity, [0.0, 0.2, 0.1], atol=1e-12)
        assert sample.feet[1].velocity is None
        assert led.run(1, tracked(0.1, 0.1, clutch=False)).feet[0].velocity is None
    assert forward > 0.02
    assert abs(aside) < 1e-9


def turned(yaw, *, clutch=True, tip=0.0):
    """The left foot, turned to the left and then tipped forward [rad]."""
    rotation = pin.exp3(np.array([0.0, 0.0, yaw])) @ pin.exp3(np.array([0.0, tip, 0.0]))
    quaternion = tuple(pin.Quaternion(rotation).coeffs().tolist())
    sample = tracked(0.0, 0.0, clutch=clutch, orientation=quaternion)
    return replace(sample, body=BodyCommand(turns=(0.1, -0.2)))


def test_a_tracked_foot_turns_as_its_tracker_does_while_its_clutch_is_closed(led):
    def turns(pad):
        return led.run(2, pad).body.turns

    for yaw in (2.9, 3.0):
        assert turns(turned(yaw, clutch=False)) == (0.1, -0.2)
    assert turns(turned(3.0)) == pytest.approx((0.1, -0.2))
    # Across half a turn, with the toes down, which turns no foot.
    led_to = turns(turned(3.3, tip=0.3))
    assert led_to == pytest.approx((0.4, -0.2), abs=1e-9)
    # It stays so when it is let go, and goes on from there.
    assert turns(turned(2.0, clutch=False))[0] == led_to[0]
    assert turns(turned(2.0))[0] == led_to[0]
    assert turns(turned(1.9))[0] == pytest.approx(0.3, abs=1e-9)
    # What is no way to hold a foot does not turn it.
    for bad in ((0.0, 0.0, 1.0, 1.0), (1.0, 0.0, 0.0, 0.0)):
        assert turns(tracked(0.0, 0.0, orientation=bad))[0] == pytest.approx(0.3)
    # Whatever else leads it says how it is turned.
    assert turns(OperatorSample(lift=(True, False))) == (0.0, 0.0)


def test_hands_head_and_body_come_as_they_are_asked_for(led):
    led.run(1, REST)
    quaternion = (0.0, 0.6, 0.0, 0.8)
    hand = TrackedPose((0.1, -0.2, 0.3), True, quaternion, (0.0, 0.3, 0.0))
    head, body = (
        TrackedPose(None, True, quaternion),
        BodyCommand(-0.05, (0.0, 0.1, 0.2), (0.3, 0.0)),
    )
    led.run(1, OperatorSample(hands=(None, replace(hand, clutch=False))))
    sample = led.run(2, OperatorSample(hands=(None, hand), head=head, body=body, rest=True))
    assert (sample.hands, sample.head, sample.body) == ((None, hand), head, body)
    assert sample.rest
    # A tracker's sample counts once.
    assert (again := led.device.sample(0.01)).hands == (None, None)
    assert again.head is None


# Keys of hands and body ------------------------------------------------------------------------


def test_keys_move_a_hand_from_where_it_is_gripped_and_its_grip_is_seen_open_first(led):
    grip = OperatorSample(grip=(False, True), reach=(1.0, 0.0, -0.5))
    assert led.run(1, grip).hands == (None, TrackedPose((0.0, 0.0, 0.0), False))
    left, right = led.run(100, grip).hands
    assert left is None
    assert right.clutch
    np.testing.assert_allclose(right.position, [0.075, 0.0, -0.0375], atol=1e-12)
    # A gripped hand that is not moved stays.
    assert led.run(10, OperatorSample(grip=(False, True))).hands[1] == right
    led.run(1, REST)
    assert led.run(1, grip).hands[1] == TrackedPose((0.0, 0.0, 0.0), False)
    # Where a tracker leads it, keys do not.
    tracker = TrackedPose((0.3, 0.0, 0.0), True)
    assert led.run(2, replace(grip, hands=(None, tracker))).hands[1] == tracker


class Bent:
    """A body that keys bend."""

    def __init__(self, *limits):
        self.operator = OperatorInputs()
        limits = limits or ((-0.1, 0.03), (0.3, 0.4, 0.5), (0.12, 0.6))
        self.device = Integrator(self.operator, DT, limits=BodyLimits(*limits))

    def hold(self, seconds, *bend, **members):
        for _ in range(round(seconds / DT)):
            self.operator.take(OperatorSample(bend=bend or (0.0,) * 5, **members))
            sample = self.device.sample(0.0)
        return sample.body


def test_what_is_asked_of_the_body_grows_stays_and_goes_back_to_neutral():
    made = Bent()
    assert made.hold(0.5, -1.0, 0.0, 0.0, 0.0, 0.0).height == pytest.approx(-0.03)
    led = made.hold(0.5, 0.0, 0.5, 1.0, -1.0, 0.0)
    assert led.torso == pytest.approx((0.1, 0.2, -0.2))
    assert made.hold(1.0) == led
    assert made.hold(0.1, neutral=True) == BodyCommand()
    # From where a slider or a program has put it keys go on.
    put = BodyCommand(-0.05, (0.0, 0.1, 0.2), (0.3, 0.0))
    assert made.hold(0.1, body=put) == put
    for _ in range(2):
        seen = made.hold(0.5, 1.0, 0.0, 0.0, 0.0, 0.0, body=put)
    assert seen.height == pytest.approx(0.01)
    assert made.hold(0.5, body=put) == seen
    assert made.hold(0.1, body=replace(put, height=-0.06)) == replace(put, height=-0.06)
    assert made.hold(0.1) == BodyCommand()


def test_what_is_asked_of_the_body_goes_no_further_than_the_robot():
    every, both = (-1.0, 1.0, -1.0, 1.0, 1.0), (True, True)
    made, most = Bent(), BodyCommand(-0.1, (0.3, -0.4, 0.5), (0.6, 0.0))
    assert made.hold(9.0, *every, lift=(True, False)) == most
    assert made.hold(9.0, 1.0, 0.0, 0.0, 0.0, 0.0).height == 0.03
    assert Bent((-0.1, 0.03)).hold(9.0, *every, lift=both) == BodyCommand(-0.1)


def test_feet_are_turned_while_they_are_held_each_against_the_other():
    left, right = (0.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0, -1.0)
    assert Bent().hold(1.0, *left).turns == (0.0, 0.0)
    turns = Bent().hold(3.0, *right, lift=(True, False)).turns
    assert turns == pytest.approx((-0.12, 0.0))
    made = Bent()
    for step in range(1, 12):
        body = made.hold(3.0, *left, lift=(step % 2 == 1, step % 2 == 0))
    # All the way round: 0.6 and 0.12 rad in turn.
    assert body.turns == pytest.approx((6 * 0.6 + 5 * 0.12 - 2 * np.pi, 5 * 0.72 - 2 * np.pi))


@pytest.mark.parametrize("actuation", ["velocity", "torque"])
def test_limits_of_the_body_are_the_robots(get_robot, actuation):
    made = Led(get_robot("biped20"), actuation)
    limits, stoop = made.device.limits, made.teleoperator.parameters.stoop_max
    assert limits.height == pytest.approx((-stoop * 0.765, 0.04 * 0.765), rel=0.01)
    turned = actuation == "torque"
    assert limits.torso == (TORSO_MOST if turned else (0.0, 0.0, 0.0))
    assert limits.turns == (FOOT_TURNS if turned else (0.0, 0.0))


# Sticks that move no foot walk the robot -------------------------------------------------------

AHEAD = (1.0, 0.0)


@pytest.fixture
def walked(get_robot):
    operator = Mock(spec=OperatorInputs)
    feet = LiveFeet(operator, StepTeleoperator(get_robot("biped20"), actuation="torque"))

    def velocity(pad):
        operator.read.return_value = pad
        sample = feet.sample(0.0)
        return None if sample is None else sample.velocity

    return velocity


def test_a_stick_walks_the_robot_ahead_once_it_was_let_go(walked):
    assert walked(REST) == (0.0, 0.0, 0.0)
    ahead, left, turn = walked(OperatorSample(move=AHEAD))
    assert ahead > 0.3
    assert (left, turn) == (0.0, 0.0)
    # One that moved a foot has to be released first, and one that was held at the start.
    assert not any(walked(OperatorSample(move=AHEAD, lift=(True, False))))
    for gap in (REST, None):
        assert not any(walked(OperatorSample(move=AHEAD)))
        assert not any(walked(REST))
        assert any(walked(OperatorSample(move=AHEAD)))
        assert not any(walked(gap) or ())
        if gap is not None:
            walked(OperatorSample(move=AHEAD, lift=(True, False)))
    assert not any(walked(OperatorSample(move=AHEAD)))


@pytest.mark.parametrize("clutch", [False, True])
def test_a_tracked_foot_that_is_not_held_keeps_no_stick_from_walking(walked, clutch):
    seen = TrackedPose(position=(0.0, 0.0, 1.0), clutch=clutch)
    walked(REST)
    assert any(walked(OperatorSample(move=AHEAD, feet=(seen, None)))) is not clutch
