"""An operator whose samples come late, in any order, from elsewhere, or not at all any more."""

import numpy as np
import pytest

pytest.importorskip("mujoco")

from careful import true_soles

from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    PoorLink,
    run_teleop,
)
from poise.errors import ConfigurationError
from poise.locomotion import (
    DeviceStatus,
    Mode,
    OperatorSample,
    ScriptedDevice,
    TrackedPose,
    WayPoint,
)

LIFT, LOWER = 0.5, 1.6
PLACES = ((LIFT, 0.0, 0.0), (1.1, 0.08, 0.08), (LOWER, 0.08, 0.08), (2.1, 0.08, -0.02))
"""A step of the right foot: when, how far ahead, how high [s, m, m]."""


ASTRAY = 1.55
"""When the hands are found elsewhere: the foot is held up by then [s]."""


def a_step(teleoperator):
    """Hands that make a step."""
    points = [WayPoint(at=at, right=(x, 0.0, z)) for at, x, z in PLACES]
    return ScriptedDevice(points, *teleoperator.estimator.anchors)


def over(**link):
    """The same hands at the end of a poor link."""

    def make(teleoperator):
        return PoorLink(a_step(teleoperator), **{"latency": 0.0, "loss": 0.0, "seed": 3} | link)

    return make


@pytest.mark.parametrize(
    ("link", "words"),
    [
        ({"latency": -0.1}, r"latency of the link \[s\] is out of range; got -0.1"),
        ({"jitter": np.nan}, r"jitter of the link \[s\] is out of range"),
        ({"loss": np.inf}, "probability of the link's losses is out of range"),
        ({"loss": 1.5}, "the link's losses have no probability; got 1.5; wanted 0 to 1"),
        ({"cut": np.nan}, r"cut of the link \[s\] is out of range; got nan"),
        ({"cut": -1.0}, r"cut of the link \[s\] is out of range; got -1.0"),
        ({"seed": -1}, "seed of the link is no whole number; got -1"),
    ],
    ids=str,
)
def test_a_link_that_cannot_be_is_refused(link, words):
    still = ScriptedDevice([], np.zeros(3), np.zeros(3))
    with pytest.raises(ConfigurationError, match=words):
        PoorLink(still, **{"latency": 0.0, "loss": 0.0, "seed": 3} | link)


class Reuses:
    """Hands that are always written into the same arrays."""

    def __init__(self):
        self._places = np.zeros((3, 3))

    def sample(self, time):
        self._places[:] = time
        left, right, hand = map(TrackedPose, self._places)
        return OperatorSample(time, (left, right), hands=(hand, None))


def test_a_device_that_reuses_its_arrays_is_late_all_the_same():
    link = PoorLink(Reuses(), latency=0.1, loss=0.0, seed=3)
    for tick in range(40):
        time = 0.01 * tick
        arrived = link.sample(time)
        if tick < 10:
            assert arrived is None
            continue
        sent = pytest.approx(np.full(3, time - 0.1))
        assert arrived.feet[0].position == sent
        assert arrived.feet[1].position == sent
        assert arrived.hands[0].position == sent


def last(run):
    return tuple(Mode)[run.log.mode[-1]], tuple(DeviceStatus)[run.log.device[-1]]


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("cut", np.linspace(LIFT + 0.05, 2.1, 5).round(3))
def test_a_connection_that_is_cut_in_mid_step_throws_nobody(get_robot, cut):
    run = run_teleop(
        get_robot("biped20"), over(cut=cut), VELOCITY_TELEOP_PLANT.with_noise(), duration=4.5
    )
    log = run.log
    assert not run.fell
    assert last(run) == (Mode.D, DeviceStatus.LOST)
    # It stands, on both feet and in the middle of them; what it knows of heights is dead reckoning,
    # by millimetres.
    np.testing.assert_allclose([sole[2] for sole in true_soles(run)], 0.0, atol=1e-3)
    np.testing.assert_allclose(log.soles[-1, :, 2], 0.0, atol=1e-2)
    np.testing.assert_allclose(log.com[-1, :2], log.zmp_reference[-1], atol=0.02)
    assert np.abs(log.com[-1] - log.com[-20]).max() < 5e-3


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize(
    ("name", "plant", "seed"),
    [
        *(("biped20", VELOCITY_TELEOP_PLANT, seed) for seed in range(3)),
        ("g1", TORQUE_TELEOP_PLANT, 0),
        ("biped20", TORQUE_TELEOP_PLANT, 1),
    ],
    ids=lambda value: str(getattr(value, "actuation", value)),
)
def test_a_link_that_loses_delays_and_mixes_up_samples_still_makes_a_step(
    get_robot, name, plant, seed
):
    device = over(loss=0.5, jitter=0.3, seed=seed)
    run = run_teleop(get_robot(name), device, plant.with_noise(), duration=4.0)
    assert not run.fell
    assert len(run.log.entries(Mode.SL)) == 1
    assert last(run)[0] is Mode.D
    assert run.log.soles[-1, 1, 0] - run.log.soles[0, 1, 0] > 0.05


class Strays:
    """Hands that make a step; in the middle of it the tracker finds them elsewhere."""

    def __init__(self, teleoperator, at, offset):
        self._device, self._at, self._offset = a_step(teleoperator), at, np.array(offset)

    def sample(self, time):
        said = self._device.sample(time)
        if time < self._at:
            return said
        left, right = (TrackedPose.of(said.place(foot) + self._offset) for foot in (0, 1))
        return OperatorSample(time, (left, right))


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("offset", [(0.5, 0.0, 0.0), (0.0, -2.0, 0.3), (0.0, 0.0, 0.5)], ids=str)
def test_hands_that_are_found_elsewhere_move_no_foot(get_robot, offset):
    run = run_teleop(
        get_robot("biped20"),
        lambda teleoperator: Strays(teleoperator, ASTRAY, offset),
        VELOCITY_TELEOP_PLANT.with_noise(),
        duration=3.5,
    )
    log = run.log
    assert not run.fell
    assert last(run)[0] is Mode.D
    # The foot comes down where the hand was last believed, and does not go after it.
    assert abs(log.soles[-1, 1, 0] - 0.08) < 0.05
    before = log.soles[log.time < ASTRAY][-1, 1]
    assert np.abs(log.soles[log.time >= ASTRAY][:, 1, :2] - before[:2]).max() < 0.05
    assert log.soles[log.time >= ASTRAY][:, 1, 2].max() < 0.09


class Naps:
    """Hands that fall silent with a foot in the air, and come back with it still held up."""

    def __init__(self, teleoperator):
        self._device, self._start = a_step(teleoperator), teleoperator.estimator.anchors.copy()

    def sample(self, time):
        if 1.2 <= time < 2.5:
            return None
        if time < 2.5:
            return self._device.sample(time)
        # Held up for a second, put down, and lifted anew.
        height = 0.08 if time < 3.5 else max(0.0, min(0.08, 0.2 * (time - 4.0)))
        left, right = self._start[0], self._start[1] + [0.08, 0.0, height]
        return OperatorSample(time, (TrackedPose.of(left), TrackedPose.of(right)))


def test_who_comes_back_leads_only_after_putting_the_device_down(get_robot):
    run = run_teleop(get_robot("biped20"), Naps, VELOCITY_TELEOP_PLANT.with_noise(), duration=6.0)
    log = run.log
    assert not run.fell
    entries = log.entries(Mode.SL)
    assert len(entries) == 2
    assert entries[1] > 4.0
    waiting = tuple(DeviceStatus).index(DeviceStatus.WAITING)
    assert (log.device[(log.time > 2.6) & (log.time < 3.4)] == waiting).all()
