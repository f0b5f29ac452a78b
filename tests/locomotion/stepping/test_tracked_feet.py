"""Trackers that lead feet: by their way since their clutch was seen closing, to where they are."""

import numpy as np
import pytest
from unchecked import run_unchecked

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.errors import ConfigurationError
from poise.locomotion import (
    DeviceStatus,
    FootTracker,
    Mode,
    OperatorSample,
    StepTeleoperator,
    TrackedFeet,
    TrackedPose,
)

PLACE = np.array([0.2, 0.1, 0.0])


def at(x=0.0, y=0.0, z=0.0, clutch=True, velocity=None):
    return TrackedPose((x, y, z), clutch, velocity=velocity)


def test_it_leads_by_its_way_as_the_robot_faces_when_it_takes_hold():
    clutch = FootTracker(scale=2.0)
    assert clutch.follow(at(1.0, clutch=False), PLACE, 0.5 * np.pi, 0.0) is None
    np.testing.assert_allclose(clutch.follow(at(1.0), PLACE, 0.5 * np.pi, 0.1).position, PLACE)
    # The robot turns meanwhile: what was ahead stays ahead.
    moved = clutch.follow(at(1.1, z=0.05, velocity=(0.1, 0.0, 0.2)), PLACE, 0.0, 0.2)
    np.testing.assert_allclose(moved.position - PLACE, [0.0, 0.2, 0.1], atol=1e-12)
    np.testing.assert_allclose(moved.velocity, [0.0, 0.2, 0.4], atol=1e-12)
    assert clutch.follow(at(1.1), PLACE, 0.0, 0.3).velocity is None


def test_a_clutch_that_was_not_seen_open_leads_nothing():
    clutch = FootTracker()
    for tick in range(5):
        assert clutch.follow(at(z=0.1 * tick), PLACE, 0.0, 0.01 * tick) is None


@pytest.mark.parametrize(
    ("tracker", "later"),
    [
        (None, 0.1),
        (at(float("nan")), 0.1),
        (at(0.0), 0.7),
        (at(0.0), -3.0),
    ],
    ids=["gone", "not a number", "after a silence", "a clock that went back"],
)
def test_what_was_lost_has_to_be_seen_open_again(tracker, later):
    clutch = FootTracker()
    clutch.follow(at(clutch=False), PLACE, 0.0, 0.0)
    assert clutch.follow(at(), PLACE, 0.0, 0.0) is not None
    for time in (later, later + 0.01, later + 0.02):
        assert clutch.follow(tracker, PLACE, 0.0, time) is None
        tracker = at(0.0)
    assert clutch.follow(at(clutch=False), PLACE, 0.0, later + 0.03) is None
    led = clutch.follow(at(0.4), PLACE, 0.0, later + 0.04)
    np.testing.assert_allclose(led.position, PLACE)


def test_a_scale_that_is_no_number_above_zero_is_refused(get_robot):
    with pytest.raises(ConfigurationError, match="scale of the trackers' ways"):
        TrackedFeet(StepTeleoperator(get_robot("biped20")), lambda: None, scale=0.0)


class Trackers:
    """The right one lifts, goes ahead, and lets go in the air; the left one is at rest."""

    def __init__(self):
        self.time, self.stamp = 0.0, 1000.0

    def __call__(self):
        self.stamp += 0.002
        self.time += 0.002
        up = 0.1 * min(max(self.time - 0.3, 0.0) / 0.4, 1.0)
        ahead = 0.12 * min(max(self.time - 1.1, 0.0) / 0.4, 1.0)
        right = at(2.0 + ahead, -1.0, 0.7 + up, clutch=0.1 < self.time < 1.7)
        return OperatorSample(self.stamp, (at(clutch=False), right))


def test_a_foot_that_is_let_go_in_the_air_comes_down_where_it_is(get_robot):
    robot = get_robot("biped20")
    plant = TORQUE_TELEOP_PLANT
    run = run_teleop(robot, lambda t: TrackedFeet(t, Trackers()), plant, duration=2.9)
    log, modes = run.log, list(Mode)
    assert not run.fell
    assert log.mode[log.time < 1.7][-1] == modes.index(Mode.SL)
    assert log.mode[-1] == modes.index(Mode.D)
    assert log.device[-1] == list(DeviceStatus).index(DeviceStatus.OK)
    start, end = log.soles[0, 1], log.soles[-1, 1]
    np.testing.assert_allclose(end - start, [0.12, 0.0, 0.0], atol=0.02)


WITHOUT_A_PLACE = """
import json, logging
import numpy as np
from poise import load_robot
from poise.locomotion import OperatorSample, StepTeleoperator, TrackedFeet, TrackedPose

lines = []
handler = logging.Handler()
handler.emit = lambda record: lines.append(record.getMessage())
logging.getLogger("poise").addHandler(handler)
good, bad = (TrackedPose(np.zeros(size), clutch=False) for size in (3, 2))
said = [bad, bad, good]
teleoperator = StepTeleoperator(load_robot("biped20"))
device = TrackedFeet(teleoperator, lambda: OperatorSample(8.0 - len(said), (good, said.pop(0))))
off = device.sample(0.0).place(1) - teleoperator.estimator.anchors[1]
error = str(device.error)
device.sample(0.1)
count = len(lines)
device.sample(0.2)
print(json.dumps([off.tolist(), error, count, device.error]))
"""


def test_a_tracker_without_a_place_is_gone_and_that_is_said_once():
    off, error, lines, later = run_unchecked(WITHOUT_A_PLACE)
    assert off == [0.0, 0.0, 0.0]
    assert error == "position of right foot: Expected `array` of length 3, got 2"
    assert lines == 1
    assert later is None


def test_a_tracker_that_is_something_else_is_said(get_robot):
    said = OperatorSample(0.0, (None, (1.0, 2.0)))
    device = TrackedFeet(StepTeleoperator(get_robot("biped20")), lambda: said)
    with pytest.raises(TypeError, match="right foot: Expected `object"):
        device.sample(0.0)
