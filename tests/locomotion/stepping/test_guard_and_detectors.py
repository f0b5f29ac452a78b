"""What reaches the controller of what a device sends, and what counts as lifted and landed."""

import numpy as np
import pytest
from walker import sample

from poise.errors import ConfigurationError
from poise.locomotion import DeviceStatus, TeleopParameters
from poise.locomotion._stepping._device import DeviceGuard
from poise.locomotion._stepping._mode_events import LandingDetector, LiftDetector


def test_good_samples_pass():
    guard = DeviceGuard()
    first = sample(0.0)
    assert guard.check(first, 0.0) is first
    assert guard.status is DeviceStatus.OK


@pytest.mark.parametrize(
    "bad",
    [
        sample(1.0, left=(np.nan, 0.0, 0.0)),
        sample(1.0, right=(np.inf, 0.0, 0.0)),
        sample(np.nan),
        sample(-1.0),
        sample(0.0),
        sample(1.0, left=(0.0, 0.5, 0.0)),
    ],
    ids=["nan", "infinite", "nan time", "older", "same time", "jump"],
)
@pytest.mark.filterwarnings("ignore")
def test_a_bad_sample_is_refused_and_the_last_good_one_holds(bad):
    guard = DeviceGuard()
    good = sample(0.0)
    guard.check(good, 0.0)
    assert guard.check(bad, 0.005) is good
    assert guard.status is DeviceStatus.REFUSED


def test_silence_is_stale_then_lost_and_a_sample_brings_it_back():
    guard = DeviceGuard(lost_after=0.5)
    good = sample(0.0)
    guard.check(good, 0.0)
    assert guard.check(None, 0.4) is good
    assert guard.status is DeviceStatus.STALE
    assert guard.check(None, 0.6) is None
    assert guard.status is DeviceStatus.LOST
    # Far from the last one: after so long it is where the hand is now.
    back = sample(0.7, left=(1.0, 0.0, 0.0))
    assert guard.check(back, 0.7) is back


def test_before_the_first_sample_the_device_is_lost():
    guard = DeviceGuard()
    assert guard.check(None, 0.0) is None
    assert guard.status is DeviceStatus.LOST


@pytest.mark.parametrize("option", ["jump_max", "lost_after"])
def test_a_guard_that_guards_nothing_is_refused(option):
    with pytest.raises(ConfigurationError, match=option):
        DeviceGuard(**{option: 0.0})


def test_a_lift_is_a_rising_edge_with_hysteresis():
    lift = LiftDetector(TeleopParameters(lift_height=0.02, lower_height=0.01))
    heights = [0.03, 0.015, 0.03, 0.005, 0.015, 0.021, 0.03, 0.012, 0.03, 0.0, 0.025]
    events = [lift.update(h) for h in heights]
    # Up at the start does not count; nor does a rise from between the two heights.
    assert [i for i, event in enumerate(events) if event] == [5, 10]


def test_landing_is_armed_by_a_foot_without_load():
    landing = LandingDetector(TeleopParameters(), 640.0)
    assert not any(landing.update(300.0, lifting=False) for _ in range(50))
    assert not any(landing.update(0.0, lifting=False) for _ in range(10))
    assert landing.update(40.0, lifting=False)


def test_a_foot_that_scrapes_while_it_is_lifted_has_not_landed():
    landing = LandingDetector(TeleopParameters(), 640.0)
    for _ in range(10):
        landing.update(0.0, lifting=True)
    assert not landing.update(100.0, lifting=True)
    assert landing.update(100.0, lifting=False)
