"""From keys, handles and gamepads to the samples of a device."""

import ctypes
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pinocchio as pin
import pytest
from msgspec.structs import replace

pytest.importorskip("websockets")

from operators import gamepad

from poise.apps.live import _inputs as inputs
from poise.apps.live._gamepad import HostGamepad, NoGamepadError
from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._integrator import (
    HOLD_HEIGHT,
    BodyLimits,
    Integrator,
    LiveFeet,
    velocity_of,
)
from poise.locomotion import (
    LATE,
    LOST_AFTER,
    BodyCommand,
    Mode,
    OperatorGuard,
    OperatorSample,
    StepTeleoperator,
    TrackedPose,
    VelocityLimits,
)
from poise.locomotion._stepping import FOOT_TURNS, TORSO_MOST

DT = 0.005


@pytest.fixture
def made(get_robot):
    operator = OperatorInputs()
    controller = StepTeleoperator(get_robot("biped20"), actuation="velocity")
    return operator, controller, LiveFeet(operator, controller)


def run(operator, device, ticks, pad):
    for tick in range(ticks):
        operator.take(pad)
        sample = device.sample(tick * DT)
    return sample


def settled(operator):
    """The sample that the loop reads once it has read all that was taken hold of and let go."""
    for _ in range(9):
        sample = operator.read()
    return sample


def test_nobody_at_the_controls_gives_no_samples(made):
    _, _, device = made
    assert device.sample(0.0) is None


def test_devices_that_hold_nothing_are_on_the_feet(made):
    operator, controller, device = made
    sample = run(operator, device, 10, OperatorSample())
    np.testing.assert_allclose(
        np.array(sample.place(0)), controller.estimator.anchors[0], atol=1e-12
    )
    np.testing.assert_allclose(
        np.array(sample.place(1)), controller.estimator.anchors[1], atol=1e-12
    )


def test_a_button_lifts_its_foot_and_no_other(made):
    operator, controller, device = made
    sample = run(operator, device, 100, OperatorSample(lift=(False, True)))
    anchors = controller.estimator.anchors
    assert np.array(sample.place(1))[2] - anchors[1][2] == pytest.approx(HOLD_HEIGHT)
    np.testing.assert_allclose(np.array(sample.place(0)), anchors[0], atol=1e-12)


def test_a_mouse_that_jumps_moves_the_device_smoothly_to_where_it_is(made):
    operator, controller, device = made
    goal = controller.estimator.anchors[0] + np.array([0.3, 0.1, 0.2])
    operator.take(OperatorSample())
    before = device.places[0]
    for tick in range(200):
        operator.take(OperatorSample(feet=(TrackedPose(tuple(goal)), None)))
        sample = device.sample(tick * DT)
        assert np.linalg.norm(np.array(sample.place(0)) - before) <= 0.6 * DT + 1e-12
        # Straight towards it.
        assert np.linalg.norm(np.cross(np.array(sample.place(0)) - before, goal - before)) < 1e-12
        before = np.array(sample.place(0))
    np.testing.assert_allclose(np.array(sample.place(0)), goal, atol=1e-12)


def test_a_handle_is_held_in_the_drawn_world(made):
    operator, controller, device = made
    device.offset = np.array([0.5, 0.0, 0.0])
    operator.take(OperatorSample())
    place = TrackedPose(tuple(controller.estimator.anchors[0] + [0.5, 0.0, 0.0]))
    sample = run(operator, device, 10, OperatorSample(feet=(place, None)))
    np.testing.assert_allclose(
        np.array(sample.place(0)), controller.estimator.anchors[0], atol=1e-12
    )


def test_an_operator_without_sign_of_life_is_gone_and_has_to_take_hold_again(made, monkeypatch):
    operator, controller, device = made
    now = 100.0
    monkeypatch.setattr(inputs.clock, "monotonic", lambda: now)
    place = TrackedPose(tuple(controller.estimator.anchors[0] + np.array([0.0, 0.0, 0.2])))
    held = OperatorSample(lift=(False, True), feet=(place, None))
    operator.take(OperatorSample())
    operator.take(held)
    assert device.sample(0.0) is not None
    assert settled(operator).feet == (place, None)
    now += LOST_AFTER + 0.01
    assert device.sample(DT) is None
    for _ in range(3):
        operator.take(held)
        assert settled(operator) == OperatorSample()
    operator.take(OperatorSample(lift=(False, True)))
    assert settled(operator) == OperatorSample()
    operator.take(held)
    assert settled(operator).feet == (place, None)
    assert settled(operator).lift == (False, False)
    operator.take(OperatorSample())
    operator.take(held)
    assert settled(operator) == held


def test_who_comes_back_with_a_stick_held_over_goes_nowhere_until_it_is_let_go(made, monkeypatch):
    operator, _, _ = made
    now = 100.0
    monkeypatch.setattr(inputs.clock, "monotonic", lambda: now)
    over = OperatorSample(move=(1.0, 0.0), turn=0.5)
    operator.take(over)
    assert settled(operator) == over
    now += LOST_AFTER + 0.01
    operator.take(over)
    operator.take(OperatorSample(move=(0.5, 0.5), turn=0.5))
    assert settled(operator) == OperatorSample()
    operator.take(OperatorSample(turn=0.5))
    operator.take(over)
    assert settled(operator) == OperatorSample(move=(1.0, 0.0))


def test_a_handle_that_was_far_away_is_back_within_a_second(made):
    operator, controller, device = made
    foot = controller.estimator.anchors[1]
    operator.take(OperatorSample())
    # Straight away from the foot, at the height at which it is held.
    sample = run(
        operator, device, 400, OperatorSample(feet=(None, TrackedPose((3e4, -4e4, foot[2] + 0.32))))
    )
    np.testing.assert_allclose(np.array(sample.place(1)) - foot, [0.144, -0.192, 0.32], atol=1e-5)
    sample = run(
        operator, device, 400, OperatorSample(feet=(None, TrackedPose((999.0, -999.0, 999.0))))
    )
    assert np.linalg.norm(np.array(sample.place(1)) - foot) == pytest.approx(0.4)
    sample = run(operator, device, 200, OperatorSample(feet=(None, TrackedPose(tuple(foot)))))
    np.testing.assert_allclose(np.array(sample.place(1)), foot, atol=1e-12)


def test_whoever_comes_next_finds_the_devices_on_the_feet(made):
    operator, controller, device = made
    run(operator, device, 100, OperatorSample(lift=(False, True)))
    operator.clear()
    assert device.sample(1.0) is None
    for place, anchor in zip(device.places, controller.estimator.anchors, strict=True):
        np.testing.assert_allclose(place, anchor, atol=1e-12)


def test_a_key_that_was_held_all_along_does_nothing_when_the_connection_is_back(made):
    operator, _, device = made
    held = OperatorSample(lift=(False, True), move=(1.0, 0.0))
    run(operator, device, 100, held)
    operator.clear()
    assert device.sample(1.0) is None
    operator.take(held)
    assert settled(operator) == OperatorSample()
    operator.take(OperatorSample())
    operator.take(held)
    assert settled(operator) == held


def test_a_stick_that_does_not_rest_at_exactly_zero_asks_for_nothing():
    limits = VelocityLimits()
    assert velocity_of(OperatorSample(move=(0.04, -0.05), turn=0.03), limits) == (0.0, 0.0, 0.0)
    ahead, left, turn = velocity_of(OperatorSample(move=(0.06, -0.06), turn=0.06), limits)
    assert ahead > 0.0 > left
    assert turn > 0.0


def test_hands_come_as_they_are_held(made):
    operator, _, device = made
    operator.take(OperatorSample())
    led = OperatorSample(hands=(None, TrackedPose((0.1, -0.2, 0.3), clutch=True)), rest=True)
    sample = run(operator, device, 2, led)
    left, right = sample.hands
    assert left is None
    assert right.clutch
    np.testing.assert_allclose(right.position, [0.1, -0.2, 0.3])
    assert sample.rest


TURNED = (0.0, 0.6, 0.0, 0.8)


def test_hands_and_head_come_as_they_are_turned(made):
    operator, _, device = made
    operator.take(OperatorSample())
    hand = TrackedPose((0.0, 0.0, 0.0), clutch=True, orientation=TURNED)
    sample = run(
        operator,
        device,
        2,
        OperatorSample(hands=(hand, None), head=TrackedPose(None, True, TURNED)),
    )
    np.testing.assert_array_equal(sample.hands[0].orientation, TURNED)
    np.testing.assert_array_equal(sample.head.orientation, TURNED)
    assert sample.head.clutch
    sample = run(operator, device, 2, OperatorSample(hands=(TrackedPose((0.0, 0.0, 0.0)), None)))
    assert sample.hands[0].orientation is None
    assert sample.head is None


def test_a_head_that_leads_when_somebody_comes_leads_nothing_until_it_is_let_go(made):
    operator, _, _ = made
    closed, opened = (
        OperatorSample(head=TrackedPose(None, True, TURNED)),
        OperatorSample(head=TrackedPose(None, False, TURNED)),
    )
    for pad, seen in (
        (closed, OperatorSample()),
        (OperatorSample(), OperatorSample()),
        (closed, OperatorSample()),
        (opened, opened),
    ):
        operator.take(pad)
        assert operator.read() == seen
    operator.take(closed)
    assert operator.read() == closed


def test_what_is_asked_of_the_body_is_in_the_sample(made):
    operator, _, device = made
    asked = BodyCommand(height=-0.05, torso=(0.0, 0.1, 0.2), turns=(0.3, 0.0))
    sample = run(operator, device, 1, OperatorSample(body=asked))
    assert sample.body == BodyCommand(-0.05, (0.0, 0.1, 0.2), (0.3, 0.0))


def test_a_hand_that_is_held_when_somebody_comes_leads_nothing_until_it_is_let_go(made):
    operator, _, _ = made
    closed = OperatorSample(hands=(TrackedPose((0.0, 0.0, 0.0), clutch=True), None))
    opened = OperatorSample(hands=(TrackedPose((0.0, 0.0, 0.0)), None))
    for pad, seen in (
        (closed, OperatorSample()),
        (OperatorSample(), OperatorSample()),
        (closed, OperatorSample()),
        (opened, opened),
    ):
        operator.take(pad)
        assert operator.read() == seen
    operator.take(closed)
    assert operator.read() == closed


def test_an_operator_who_leaves_is_gone_at_once(made):
    operator, _, device = made
    operator.take(OperatorSample())
    operator.clear()
    assert device.sample(0.0) is None


def test_shoulder_buttons_lift_and_the_stick_moves_forward_and_left():
    sample = gamepad("LEFTSHOULDER", LEFTX=-1.0, LEFTY=-0.5)
    assert sample == OperatorSample(lift=(True, False), move=(0.5, 1.0))
    sample = gamepad("A", "RIGHTSHOULDER", LEFTX=0.1, LEFTY=-0.1)
    assert sample == OperatorSample(lift=(False, True), upright=True)


def test_each_stick_moves_its_own_foot_where_both_are_held():
    sample = gamepad(
        "LEFTSHOULDER", "RIGHTSHOULDER", LEFTX=0.5, LEFTY=-1.0, RIGHTX=-0.6, RIGHTY=0.4
    )
    assert sample == OperatorSample(
        lift=(True, True), move=(1.0, -0.5), second=(-0.4, 0.6), turn=0.6
    )


def test_the_d_pad_sends_the_body_up_and_the_held_foot_around_and_with_b_the_torso():
    assert gamepad() == OperatorSample()
    assert gamepad("DPAD_LEFT", "DPAD_UP").bend == (1.0, 0.0, 0.0, 0.0, 1.0)
    assert gamepad("B", "DPAD_RIGHT", "DPAD_DOWN").bend == (0.0, 0.0, -1.0, -1.0, 0.0)
    assert gamepad("Y").neutral


BEND_LIMITS = BodyLimits((-0.1, 0.03), (0.3, 0.4, 0.5), (0.12, 0.6))


class Bent:
    """A body that keys bend."""

    def __init__(self, limits=BEND_LIMITS):
        self.operator = OperatorInputs()
        self.device = Integrator(self.operator, DT, limits=limits)

    def hold(self, seconds, *bend, lift=(False, False), **members):
        sample = OperatorSample(lift=lift, bend=bend or (0.0,) * 5, **members)
        return run(self.operator, self.device, round(seconds / DT), sample).body


def test_what_is_asked_of_the_body_grows_stays_and_goes_back_to_neutral():
    made = Bent()
    lower = made.hold(0.5, -1.0, 0.0, 0.0, 0.0, 0.0)
    assert lower.height == pytest.approx(-0.03)
    led = made.hold(0.5, 0.0, 0.5, 1.0, -1.0, 0.0)
    assert led.torso == pytest.approx((0.1, 0.2, -0.2))
    assert made.hold(1.0) == led
    assert made.hold(0.1, neutral=True) == BodyCommand()


def test_keys_bend_the_body_on_from_where_a_slider_or_a_program_has_put_it():
    made, put = Bent(), BodyCommand(-0.05, (0.0, 0.1, 0.2), (0.3, 0.0))
    assert made.hold(0.1, body=put) == put
    assert made.hold(0.5, 1.0, 0.0, 0.0, 0.0, 0.0, body=put).height == pytest.approx(-0.02)
    assert made.hold(0.5, body=put).height == pytest.approx(-0.02)
    assert made.hold(0.1, body=replace(put, height=-0.06)) == replace(put, height=-0.06)
    assert made.hold(0.1) == BodyCommand()


def test_what_is_asked_of_the_body_goes_no_further_than_the_robot():
    every = (-1.0, 1.0, -1.0, 1.0, 1.0)
    made = Bent()
    assert made.hold(9.0, *every, lift=(True, False)) == BodyCommand(
        -0.1, (0.3, -0.4, 0.5), (0.6, 0.0)
    )
    assert made.hold(9.0, 1.0, 0.0, 0.0, 0.0, 0.0).height == 0.03
    both = (True, True)
    only_height = Bent(BodyLimits((-0.1, 0.03))).hold(9.0, *every, lift=both)
    assert only_height == BodyCommand(-0.1)
    assert Bent(BodyLimits()).hold(9.0, *every, lift=both) == BodyCommand()


def test_feet_are_turned_while_they_are_held_each_against_the_other():
    left, right = (0.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0, -1.0)
    assert Bent().hold(1.0, *left).turns == (0.0, 0.0)
    turned = Bent().hold(3.0, *right, lift=(True, False)).turns
    assert turned == pytest.approx((-0.12, 0.0))
    made = Bent()
    for step in range(1, 12):
        body = made.hold(3.0, *left, lift=(step % 2 == 1, step % 2 == 0))
    # All the way round: 0.6 and 0.12 rad in turn.
    assert body.turns == pytest.approx((6 * 0.6 + 5 * 0.12 - 2 * np.pi, 5 * 0.72 - 2 * np.pi))


def test_keys_move_a_hand_from_where_it_is_gripped_and_its_grip_is_seen_open_first(made):
    operator, _, device = made
    grip = OperatorSample(grip=(False, True), reach=(1.0, 0.0, -0.5))
    assert run(operator, device, 1, grip).hands == (None, TrackedPose((0.0, 0.0, 0.0), False))
    left, right = run(operator, device, 100, grip).hands
    assert left is None
    assert right.clutch
    np.testing.assert_allclose(right.position, [0.075, 0.0, -0.0375], atol=1e-12)
    # A gripped hand that is not moved stays.
    still = run(operator, device, 10, OperatorSample(grip=(False, True))).hands[1]
    assert still == right
    run(operator, device, 1, OperatorSample())
    assert run(operator, device, 1, grip).hands[1] == TrackedPose((0.0, 0.0, 0.0), False)
    # Where a tracker leads it, keys do not.
    led = TrackedPose((0.3, 0.0, 0.0), True)
    sample = run(operator, device, 2, replace(grip, hands=(None, led)))
    assert sample.hands[1] == led


@pytest.mark.parametrize("actuation", ["velocity", "torque"])
def test_limits_of_the_body_are_the_robots(get_robot, actuation):
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation=actuation)
    limits = BodyLimits.of(teleoperator)
    assert limits.height[0] == pytest.approx(-teleoperator.parameters.stoop_max * 0.765, rel=0.01)
    turned = actuation == "torque"
    assert limits.torso == (TORSO_MOST if turned else (0.0, 0.0, 0.0))
    assert limits.turns == (FOOT_TURNS if turned else (0.0, 0.0))


class VirtualPad:
    """A gamepad in SDL itself, with its parts where Linux has those of one for the Xbox.

    Between the axes of its sticks stand triggers, which rest at the end of theirs.
    """

    MAPPING = {  # noqa: RUF012
        "a": "b0",
        "b": "b1",
        "x": "b2",
        "y": "b3",
        "leftshoulder": "b4",
        "rightshoulder": "b5",
        "leftx": "a0",
        "lefty": "a1",
        "rightx": "a3",
        "righty": "a4",
        "lefttrigger": "a2",
        "righttrigger": "a5",
        "dpup": "h0.1",
        "dpright": "h0.2",
        "dpdown": "h0.4",
        "dpleft": "h0.8",
    }
    RESTING = (0, 0, -32768, 0, 0, -32768)
    Y, LEFT_SHOULDER = 3, 4

    def __init__(self):
        pygame = pytest.importorskip("pygame")
        from pygame._sdl2 import controller

        self._pygame, self._controller = pygame, controller
        pygame.display.init()
        pygame.joystick.init()
        controller.init()
        maps = Path("/proc/self/maps").read_text()
        library = next(line.split()[-1] for line in maps.splitlines() if "libSDL2-2" in line)
        self._sdl = ctypes.CDLL(library)
        self._sdl.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p
        self.index = None

    def plug(self, *, known=True):
        self.index = self._sdl.SDL_JoystickAttachVirtual(int(known), 6, 11, 1)
        stick = self._pygame.joystick.Joystick(self.index)
        if known:
            self._controller.Controller(self.index).set_mapping(self.MAPPING)
        number = stick.get_instance_id()
        self._stick = ctypes.c_void_p(self._sdl.SDL_JoystickFromInstanceID(number))
        self._held = stick
        self.push()

    def push(self, *, buttons=(), hat=0, axes=RESTING):
        for axis, value in enumerate(axes):
            self._sdl.SDL_JoystickSetVirtualAxis(self._stick, axis, ctypes.c_int16(value))
        for button in range(11):
            self._sdl.SDL_JoystickSetVirtualButton(self._stick, button, int(button in buttons))
        self._sdl.SDL_JoystickSetVirtualHat(self._stick, 0, hat)

    def pull(self):
        if self.index is not None:
            assert self._sdl.SDL_JoystickDetachVirtual(self.index) == 0
            self.index = None
            self._pygame.event.get()


@pytest.fixture
def virtual_pad(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setenv("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    pad = VirtualPad()
    yield pad
    pad.pull()


def test_a_gamepad_that_nobody_touches_asks_for_nothing(virtual_pad):
    virtual_pad.plug()
    operator = OperatorInputs()
    host = HostGamepad(operator)
    host.poll()
    assert operator.read() == OperatorSample()


def test_its_sticks_are_found_between_its_triggers(virtual_pad):
    virtual_pad.plug()
    operator = OperatorInputs()
    host = HostGamepad(operator)
    virtual_pad.push(axes=(16384, -32768, 32767, -16384, 8192, 32767))
    host.poll()
    pad = operator.read()
    assert pad.move == (1.0, -0.5)
    assert pad.second == (-0.25, 0.5)
    assert pad.turn == 0.5


def test_a_gamepad_of_the_robots_machine_bends_the_body_and_keeps_it(virtual_pad):
    virtual_pad.plug()
    operator = OperatorInputs()
    host, device = HostGamepad(operator), Integrator(operator, DT, limits=BEND_LIMITS)
    virtual_pad.push(buttons=[virtual_pad.LEFT_SHOULDER], hat=4 | 8)

    def polled(ticks):
        for tick in range(ticks):
            host.poll()
            sample = device.sample(tick * DT)
        return sample.body

    asked = polled(20)
    assert operator.read().lift == (True, False)
    assert asked.height == pytest.approx(-0.006)
    assert asked.turns == pytest.approx((0.04, 0.0))
    virtual_pad.push()
    assert polled(2) == asked
    virtual_pad.push(buttons=[virtual_pad.Y])
    assert polled(2) == BodyCommand()


def test_a_gamepad_that_was_pulled_out_works_again_when_it_is_plugged_in(virtual_pad):
    virtual_pad.plug()
    operator = OperatorInputs()
    host = HostGamepad(operator)
    virtual_pad.pull()
    host.poll()
    assert operator.read() is None
    virtual_pad.plug()
    virtual_pad.push(buttons=[virtual_pad.LEFT_SHOULDER])
    host.poll()
    assert operator.read().lift == (True, False)


def test_without_a_gamepad_or_with_one_of_no_known_layout_that_is_said(virtual_pad):
    with pytest.raises(NoGamepadError, match="no gamepad on this machine"):
        HostGamepad(OperatorInputs())
    virtual_pad.plug(known=False)
    with pytest.raises(NoGamepadError, match="SDL_GAMECONTROLLERCONFIG"):
        HostGamepad(OperatorInputs())


def test_a_gamepad_of_the_robots_machine_shakes_when_a_foot_lands(virtual_pad, monkeypatch):
    virtual_pad.plug()
    host = HostGamepad(OperatorInputs())
    monkeypatch.setattr(host, "_pad", Mock())
    host.shake(0)
    assert not host._pad.rumble.called
    host.shake(1)
    host.shake(1)
    host._pad.rumble.assert_called_once()


@pytest.mark.parametrize("mode", [Mode.SL, Mode.SR])
@pytest.mark.parametrize("both", [False, True])
def test_with_one_foot_held_either_stick_moves_it_and_with_both_its_own(made, mode, both):
    operator, controller, device = made
    controller._level = Mock(mode=mode, footing=None)
    foot = 1 - mode.support
    start = device.places[foot][0]
    lift = (True, True) if both else (foot == 0, foot == 1)
    for stick, own in (("move", foot == 0), ("second", foot == 1)):
        device.places[foot][0] = start
        run(operator, device, 20, OperatorSample(lift=lift, **{stick: (1.0, 0.0)}))
        moved = bool(device.places[foot][0] > start + 0.02)
        assert moved is (own or not both)


def tracked(x, z, *, clutch=True):
    """The left foot as a tracker sees it, from a place of its own."""
    return OperatorSample(
        feet=(TrackedPose(position=(7.0 + x, -3.0, 1.2 + z), clutch=clutch), None)
    )


def test_a_tracked_foot_leads_by_what_it_moves_while_its_clutch_is_closed(made):
    operator, controller, device = made
    anchor = controller.estimator.anchors[0]
    run(operator, device, 5, tracked(0.0, 0.0, clutch=False))
    sample = run(operator, device, 5, tracked(0.0, 0.0))
    np.testing.assert_allclose(np.array(sample.place(0)), anchor, atol=1e-12)
    sample = run(operator, device, 40, tracked(0.1, 0.05))
    np.testing.assert_allclose(np.array(sample.place(0)) - anchor, [0.1, 0.0, 0.05], atol=1e-12)
    # Let go, moved back and taken hold of anew: further ahead than the hand ever was.
    lifted = OperatorSample(lift=(True, False))
    for x in (0.1, 0.0):
        operator.take(replace(lifted, feet=tracked(x, 0.05, clutch=False).feet))
        device.sample(0.0)
    place = device.places[0].copy()
    run(operator, device, 1, tracked(0.0, 0.05))
    sample = run(operator, device, 40, tracked(0.1, 0.05))
    np.testing.assert_allclose(np.array(sample.place(0)) - place, [0.1, 0.0, 0.0], atol=5e-3)


@pytest.mark.parametrize("lead", ["stick", "tracker"])
def test_forward_is_where_the_robot_faces(made, lead):
    operator, controller, device = made
    # It has been turned by a quarter to the left.
    controller._ahead = np.pi / 2.0
    begin = device.places[0].copy()
    if lead == "stick":
        controller._level = Mock(mode=Mode.SR, footing=None)
        sample = run(operator, device, 20, OperatorSample(lift=(True, False), move=(1.0, 0.0)))
    else:
        run(operator, device, 2, tracked(0.0, 0.0, clutch=False))
        run(operator, device, 2, tracked(0.0, 0.0))
        sample = run(operator, device, 40, tracked(0.05, 0.02))
    forward, aside = (
        np.array(sample.place(0))[1] - begin[1],
        np.array(sample.place(0))[0] - begin[0],
    )
    assert forward > 0.02
    assert abs(aside) < 1e-9


def turned(yaw, *, clutch=True, tip=0.0):
    """The left foot, turned to the left and then tipped forward [rad]."""
    quaternion = pin.Quaternion(
        pin.exp3(np.array([0.0, 0.0, yaw])) @ pin.exp3(np.array([0.0, tip, 0.0]))
    )
    seen = TrackedPose(
        position=(0.0, 0.0, 1.0), clutch=clutch, orientation=tuple(quaternion.coeffs().tolist())
    )
    return OperatorSample(feet=(seen, None), body=BodyCommand(turns=(0.1, -0.2)))


def test_a_tracked_foot_turns_as_its_tracker_does_while_its_clutch_is_closed(made):
    operator, _, device = made
    for yaw in (2.9, 3.0):
        assert run(operator, device, 2, turned(yaw, clutch=False)).body.turns == (0.1, -0.2)
    assert run(operator, device, 2, turned(3.0)).body.turns == pytest.approx((0.1, -0.2))
    # Across half a turn, with the toes down, which turns no foot.
    sample = run(operator, device, 2, turned(3.3, tip=0.3))
    assert sample.body.turns == pytest.approx((0.4, -0.2), abs=1e-9)
    # It stays so when it is let go, and goes on from there.
    assert run(operator, device, 2, turned(2.0, clutch=False)).body.turns[0] == sample.body.turns[0]
    assert run(operator, device, 2, turned(2.0)).body.turns[0] == sample.body.turns[0]
    assert run(operator, device, 2, turned(1.9)).body.turns[0] == pytest.approx(0.3, abs=1e-9)
    # Whatever else leads it says how it is turned.
    assert run(operator, device, 2, OperatorSample(lift=(True, False))).body.turns == (0.0, 0.0)


@pytest.mark.parametrize("bad", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 1.0), (1.0, 0.0, 0.0, 0.0)])
def test_what_is_no_way_to_hold_a_foot_does_not_turn_it(made, bad):
    operator, _, device = made
    run(operator, device, 2, turned(0.0, clutch=False))
    run(operator, device, 2, turned(0.0))
    pad = OperatorSample(
        feet=(TrackedPose(position=(0.0, 0.0, 1.0), clutch=True, orientation=bad), None)
    )
    assert run(operator, device, 2, turned(0.2)).body.turns[0] == pytest.approx(0.3)
    assert run(operator, device, 2, pad).body.turns[0] == pytest.approx(0.3)
    assert run(operator, device, 2, turned(0.5)).body.turns[0] == pytest.approx(0.3)
    assert run(operator, device, 2, turned(0.6)).body.turns[0] == pytest.approx(0.4)


def test_a_clutch_that_was_open_within_a_burst_of_messages_was_open(made):
    operator, controller, device = made
    anchor = controller.estimator.anchors[0]
    run(operator, device, 2, tracked(0.0, 0.0, clutch=False))
    run(operator, device, 2, tracked(0.0, 0.0))
    sample = run(operator, device, 40, tracked(0.05, 0.05))
    np.testing.assert_allclose(np.array(sample.place(0)) - anchor, [0.05, 0.0, 0.05], atol=1e-12)
    # Let go, moved on and taken hold of anew, all before the robot's loop looks again.
    operator.take(tracked(0.05, 0.05, clutch=False))
    operator.take(tracked(0.12, 0.05, clutch=False))
    operator.take(tracked(0.12, 0.05))
    operator.take(tracked(0.12, 0.05))
    device.sample(0.0)
    place = device.places[0].copy()
    sample = run(operator, device, 40, tracked(0.12, 0.05))
    np.testing.assert_allclose(np.array(sample.place(0)), place, atol=1e-12)


def test_hands_and_head_that_were_open_within_a_burst_are_seen_so_once(made):
    operator, _, _ = made
    for clutch in (False, True):
        hand = TrackedPose(position=(0.1, 0.0, 0.0), clutch=clutch)
        head = TrackedPose(None, clutch, (0.0, 0.0, 0.0, 1.0))
        operator.take(OperatorSample(hands=(None, hand), head=head, turn=0.5))
    seen = operator.read()
    assert not seen.hands[1].clutch
    assert not seen.head.clutch
    assert seen.hands[0] is None
    assert seen.turn == 0.5
    seen = operator.read()
    assert seen.hands[1].clutch
    assert seen.head.clutch


def test_a_tracked_foot_does_not_jump(made):
    operator, controller, device = made
    run(operator, device, 2, tracked(0.0, 0.0, clutch=False))
    run(operator, device, 2, tracked(0.0, 0.0))
    guard, soles, ways = OperatorGuard(dt=DT), controller.estimator.anchors, []
    for tick in range(60):
        sample = run(operator, device, 1, tracked(0.02 * tick, 0.01 * tick))
        followed = guard.check(replace(sample, time=DT * tick), DT * tick, soles, soles)
        ways.append(np.subtract(followed.place(0), soles[0]))
    # In a time t no more than 6 cm and 2.5 m/s t, and straight.
    assert all(np.linalg.norm(way) <= 0.06 + 2.5 * DT * k + 1e-9 for k, way in enumerate(ways))
    np.testing.assert_allclose([way[2] for way in ways], [0.5 * way[0] for way in ways], atol=1e-9)


@pytest.mark.parametrize("gap", ["lost", "silent"])
def test_a_tracked_foot_that_was_lost_leads_only_by_a_fresh_clutch(made, monkeypatch, gap):
    operator, controller, device = made
    anchor = controller.estimator.anchors[0]
    now = 100.0
    monkeypatch.setattr(inputs.clock, "monotonic", lambda: now)
    run(operator, device, 2, tracked(0.0, 0.0, clutch=False))
    run(operator, device, 2, tracked(0.0, 0.0))
    if gap == "lost":
        run(operator, device, 2, OperatorSample())
    else:
        now += LOST_AFTER + 0.01
        assert device.sample(0.0) is None
    for x in (0.0, 0.1, 0.2):
        sample = run(operator, device, 40, tracked(1.0 + x, 0.1))
        np.testing.assert_allclose(np.array(sample.place(0)), anchor, atol=1e-12)
    run(operator, device, 2, tracked(1.2, 0.1, clutch=False))
    run(operator, device, 2, tracked(1.2, 0.1))
    sample = run(operator, device, 40, tracked(1.3, 0.15))
    np.testing.assert_allclose(np.array(sample.place(0)) - anchor, [0.1, 0.0, 0.05], atol=1e-12)


def test_a_tracker_that_says_how_fast_it_is_says_so_of_the_foot_that_follows_it(made, monkeypatch):
    operator, _, device = made
    monkeypatch.setattr(StepTeleoperator, "ahead", np.pi / 2)
    fast = (0.2, 0.0, 0.1)
    held = replace(tracked(1.0, 0.1), feet=(TrackedPose((1.0, 0.0, 0.1), True, None, fast), None))
    run(operator, device, 2, tracked(1.0, 0.1, clutch=False))
    sample = run(operator, device, 2, held)
    np.testing.assert_allclose(sample.feet[0].velocity, [0.0, 0.2, 0.1], atol=1e-12)
    assert sample.feet[1].velocity is None
    # One that is let go does not go.
    assert run(operator, device, 1, tracked(1.2, 0.1, clutch=False)).feet[0].velocity is None


def test_a_tracked_hand_says_how_fast_it_is(made):
    operator, _, device = made
    hand = TrackedPose((0.0, 0.0, 0.0), True, None, (0.0, 0.3, 0.0))
    run(operator, device, 1, OperatorSample())
    sample = run(operator, device, 1, OperatorSample(hands=(hand, TrackedPose((0.0, 0.0, 0.0)))))
    np.testing.assert_array_equal(sample.hands[0].velocity, [0.0, 0.3, 0.0])
    assert sample.hands[1].velocity is None


def test_a_hand_that_is_nowhere_moves_nothing_and_leads_on_when_it_is_back(made):
    operator, controller, device = made
    guard, soles, time = OperatorGuard(dt=DT), controller.estimator.anchors, 0.0

    def moved(hand):
        nonlocal time
        time += DT
        raw = OperatorSample(lift=(False, True), hands=(hand, None))
        guard.check(replace(run(operator, device, 1, raw), time=time), time, soles, soles)
        assert operator.read().lift == (False, True)
        return guard.hands[0].step[0]

    near = TrackedPose((0.1, 0.0, 0.0), clutch=True)
    moved(replace(near, clutch=False))
    assert moved(near) == 0.0
    assert [moved(TrackedPose((x, 0.0, 0.0), True)) for x in (1e9, -1e300, 9.0)] == [0.0] * 3
    assert moved(replace(near, position=(0.11, 0.0, 0.0))) == pytest.approx(0.01)
    # Nor does a velocity that no hand has.
    moved(replace(near, velocity=(0.0, -100.0, 0.0)))
    assert guard.hands[0].velocity(time) is None


def test_a_sample_counts_for_as_long_as_the_slowest_device_takes_to_the_next(made, monkeypatch):
    operator, _, device = made
    now = 100.0
    monkeypatch.setattr(inputs.clock, "monotonic", lambda: now)
    operator.take(OperatorSample(lift=(True, False)))
    assert device.sample(0.0) is not None
    now += 0.09
    assert device.sample(DT) is not None
    now += 0.02
    assert operator.read() is None
    assert device.sample(2 * DT) is None


def test_messages_that_others_have_overtaken_are_dropped(made):
    operator, _, _ = made
    assert operator.take(OperatorSample(time=1.0, turn=0.1)) == {}
    assert operator.take(OperatorSample(time=1.03, turn=0.2)) == {}
    assert operator.take(OperatorSample(time=1.01, turn=0.3)) == {"old": pytest.approx(0.02)}
    assert operator.read().turn == 0.2
    operator.take(OperatorSample(turn=0.4))
    assert operator.read().turn == 0.4


@pytest.mark.parametrize("jump", [-1e3, -0.1, 1e6])
def test_a_senders_clock_that_jumps_locks_nobody_out(made, monkeypatch, jump):
    operator, _, _ = made
    now = 100.0
    monkeypatch.setattr(inputs.clock, "monotonic", lambda: now)
    for tick in range(60):
        now = 100.0 + 0.033 * tick
        # Ahead for one message only, or back for good.
        ahead = jump if (tick == 20 if jump > 0 else tick >= 20) else 0.0
        operator.take(OperatorSample(time=2e3 + 0.033 * tick + ahead, turn=0.01 * tick))
    operator.take(OperatorSample(time=2e3 + 0.033 * 61 + min(jump, 0.0)))
    operator.take(OperatorSample(time=2e3 + 0.033 * 62 + min(jump, 0.0), turn=0.9))
    assert settled(operator).turn == 0.9


@pytest.mark.parametrize(
    ("stamp", "why"),
    [
        (lambda s: 5e3 + 1e3 * s, "early"),
        (lambda s: 1.0 + 0.03 * s, "late"),
        (lambda s: 7.0, "old"),
    ],
    ids=["milliseconds", "slow", "frozen"],
)
def test_a_clock_that_is_none_in_seconds_is_told_of(made, monkeypatch, stamp, why):
    operator, _, _ = made
    now = 100.0
    monkeypatch.setattr(inputs.clock, "monotonic", lambda: now)
    told = []
    for tick in range(60):
        now = 100.0 + 0.033 * tick
        told.append(operator.take(OperatorSample(time=stamp(0.033 * tick))))
    assert {key for answer in told for key in answer} == {why}
    assert operator.take(OperatorSample()) == {}


@pytest.mark.parametrize("slower", [1e-4, 0.02, 0.5])
def test_who_comes_later_and_later_is_silent_until_they_take_hold_anew(made, monkeypatch, slower):
    operator, _, _ = made
    now, lifted = 100.0, OperatorSample(lift=(True, False))
    monkeypatch.setattr(inputs.clock, "monotonic", lambda: now)
    led, late = [], []
    for tick in range(1500):
        # A clock that drifts, or a link that has more to carry than it can.
        now = 100.0 + 0.033 * (1.0 + slower) * tick
        operator.take(replace(lifted, time=5.0 + 0.033 * tick))
        led.append((pad := operator.read()) is not None and pad.lift[0])
        late.append(now - 100.0 - 0.033 * tick)
    gone = led.index(False) if False in led else len(led)
    assert max(late[:gone]) < LATE + LOST_AFTER + 0.1
    assert not any(led[gone:])
    assert (gone == len(led)) == (slower == 1e-4)
    operator.take(OperatorSample(time=5.0 + 0.033 * 1500))
    operator.take(replace(lifted, time=5.0 + 0.033 * 1501))
    assert settled(operator).lift[0]


def test_times_of_messages_that_the_loop_took_are_kept():
    operator = OperatorInputs()
    operator.take(OperatorSample())
    operator.commanded(1.0)
    assert not operator.stages
    operator.read()
    operator.commanded(1.0)
    assert len(operator.stages) == 1
