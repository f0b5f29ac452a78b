"""Sticks that move no foot walk the robot, once they have been let go."""

from unittest.mock import Mock

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")


from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._integrator import LiveFeet
from poise.locomotion import OperatorSample, StepTeleoperator, TrackedPose

AHEAD = (1.0, 0.0)


@pytest.fixture
def walked(get_robot):
    inputs = Mock(spec=OperatorInputs)
    feet = LiveFeet(inputs, StepTeleoperator(get_robot("biped20"), actuation="torque"))

    def velocity(pad):
        inputs.read.return_value = pad
        sample = feet.sample(0.0)
        return None if sample is None else sample.velocity

    return velocity


def test_a_stick_walks_the_robot_ahead(walked):
    assert walked(OperatorSample()) == (0.0, 0.0, 0.0)
    ahead, left, turn = walked(OperatorSample(move=AHEAD))
    assert ahead > 0.3
    assert (left, turn) == (0.0, 0.0)
    assert walked(OperatorSample()) == (0.0, 0.0, 0.0)


def test_one_that_led_a_foot_has_to_be_let_go_first(walked):
    walked(OperatorSample())
    assert not any(walked(OperatorSample(move=AHEAD, lift=(True, False))))
    assert not any(walked(OperatorSample(move=AHEAD)))
    assert not any(walked(OperatorSample()))
    assert any(walked(OperatorSample(move=AHEAD)))


def test_one_that_is_held_when_somebody_comes_does_nothing(walked):
    walked(OperatorSample())
    assert walked(None) is None
    assert not any(walked(OperatorSample(move=AHEAD)))


def test_a_tracked_foot_that_is_not_held_keeps_no_stick_from_walking(walked):
    for clutch in (False, True):
        seen = TrackedPose(position=(0.0, 0.0, 1.0), clutch=clutch)
        walked(OperatorSample())
        assert any(walked(OperatorSample(move=AHEAD, feet=(seen, None)))) is not clutch
