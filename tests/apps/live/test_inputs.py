"""From keys, handles and gamepads to the samples of a device."""

import numpy as np
import pytest

pytest.importorskip("websockets")

from poise.apps.live import LiveFeet, OperatorInputs, Pad, _inputs as inputs
from poise.apps.live._gamepad import pad_from
from poise.locomotion import StepTeleoperator

DT = 0.005


@pytest.fixture
def made(get_robot):
    operator = OperatorInputs()
    controller = StepTeleoperator(get_robot("biped20"))
    return operator, controller, LiveFeet(operator, controller)


def run(operator, device, ticks, pad):
    for tick in range(ticks):
        operator.pad(pad)
        sample = device.sample(tick * DT)
    return sample


def test_nobody_at_the_controls_gives_no_samples(made):
    _, _, device = made
    assert device.sample(0.0) is None


def test_devices_that_hold_nothing_are_on_the_feet(made):
    operator, controller, device = made
    sample = run(operator, device, 10, Pad())
    np.testing.assert_allclose(sample.left, controller.estimator.anchors[0], atol=1e-12)
    np.testing.assert_allclose(sample.right, controller.estimator.anchors[1], atol=1e-12)


def test_a_button_lifts_its_foot_and_no_other(made):
    operator, controller, device = made
    sample = run(operator, device, 100, Pad(lift=(False, True)))
    anchors = controller.estimator.anchors
    assert sample.right[2] - anchors[1][2] == pytest.approx(inputs.HOLD_HEIGHT)
    np.testing.assert_allclose(sample.left, anchors[0], atol=1e-12)


def test_a_mouse_that_jumps_moves_the_device_smoothly_to_where_it_is(made):
    operator, controller, device = made
    goal = controller.estimator.anchors[0] + np.array([0.3, 0.1, 0.2])
    operator.pad(Pad())
    before = device.places[0]
    for tick in range(200):
        operator.pad(Pad(drag=(tuple(goal), None)))
        sample = device.sample(tick * DT)
        assert np.abs(sample.left - before).max() <= 0.6 * DT + 1e-12
        before = sample.left
    np.testing.assert_allclose(sample.left, goal, atol=1e-12)


def test_a_handle_is_held_in_the_drawn_world(made):
    operator, controller, device = made
    device.offset = np.array([0.5, 0.0, 0.0])
    operator.pad(Pad())
    place = tuple(controller.estimator.anchors[0] + device.offset)
    sample = run(operator, device, 10, Pad(drag=(place, None)))
    np.testing.assert_allclose(sample.left, controller.estimator.anchors[0], atol=1e-12)


def test_an_operator_without_sign_of_life_is_gone_and_has_to_take_hold_again(made, monkeypatch):
    operator, controller, device = made
    now = 100.0
    monkeypatch.setattr(inputs.clock, "monotonic", lambda: now)
    place = tuple(controller.estimator.anchors[0] + np.array([0.0, 0.0, 0.2]))
    held = Pad(lift=(False, True), drag=(place, None))
    operator.pad(Pad())
    operator.pad(held)
    assert device.sample(0.0) is not None
    assert operator.read().drag == (place, None)
    now += inputs.FRESH_FOR + 0.01
    assert device.sample(DT) is None
    for _ in range(3):
        operator.pad(held)
        assert operator.read() == Pad()
    operator.pad(Pad(lift=(False, True)))
    assert operator.read() == Pad()
    operator.pad(held)
    assert operator.read().drag == (place, None)
    assert operator.read().lift == (False, False)
    operator.pad(Pad())
    operator.pad(held)
    assert operator.read() == held


def test_who_comes_back_with_a_stick_held_over_goes_nowhere_until_it_is_let_go(made, monkeypatch):
    operator, _, _ = made
    now = 100.0
    monkeypatch.setattr(inputs.clock, "monotonic", lambda: now)
    over = Pad(move=(1.0, 0.0), turn=0.5)
    operator.pad(over)
    assert operator.read() == over
    now += inputs.FRESH_FOR + 0.01
    operator.pad(over)
    operator.pad(Pad(move=(0.5, 0.5), turn=0.5))
    assert operator.read() == Pad()
    operator.pad(Pad(turn=0.5))
    operator.pad(over)
    assert operator.read() == Pad(move=(1.0, 0.0))


def test_a_handle_that_was_far_away_is_back_within_a_second(made):
    operator, controller, device = made
    foot = controller.estimator.anchors[1]
    operator.pad(Pad())
    sample = run(operator, device, 400, Pad(drag=(None, (99.0, -99.0, 99.0))))
    assert np.abs(sample.right - foot).max() < 0.5
    sample = run(operator, device, 200, Pad(drag=(None, tuple(foot))))
    np.testing.assert_allclose(sample.right, foot, atol=1e-12)


def test_whoever_comes_next_finds_the_devices_on_the_feet(made):
    operator, controller, device = made
    run(operator, device, 100, Pad(lift=(False, True)))
    operator.clear()
    assert device.sample(1.0) is None
    for place, anchor in zip(device.places, controller.estimator.anchors, strict=True):
        np.testing.assert_allclose(place, anchor, atol=1e-12)


def test_an_operator_who_leaves_is_gone_at_once(made):
    operator, _, device = made
    operator.pad(Pad())
    operator.clear()
    assert device.sample(0.0) is None


def test_shoulder_buttons_lift_and_the_stick_moves_forward_and_left():
    pad = pad_from([0, 0, 0, 0, 1, 0], [-1.0, -0.5])
    assert pad == Pad(lift=(True, False), move=(0.5, 1.0))
    assert pad_from([1, 0, 0, 0, 0, 1], [0.1, -0.1]) == Pad(lift=(False, True), upright=True)


def test_a_gamepad_with_few_parts_is_no_error():
    assert pad_from([], []) == Pad()
