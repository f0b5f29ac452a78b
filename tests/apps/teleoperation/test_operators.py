"""Operators whose samples come late or not at all, who hurry, and who ask for too much."""

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
        ({"loss": 1.5}, "the link's losses have no probability; got 1.5; wanted 0 to 1"),
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


UP, FORWARD, DOWN = 0.10, 0.08, 0.07
"""Height at which a foot is held, way ahead, and depth below the floor of its goal [m]."""

STICK, LET_GO = 0.25, 0.15
"""Speeds of a device forward and down [m/s]."""


class Eager:
    """Lifts a foot, moves it ahead and releases it, then the other one without a pause."""

    def __init__(self, teleoperator, phase, steps):
        self._teleoperator, self._begin, self.steps = teleoperator, 0.5 + phase, steps
        self._dt, self._foot, self._ahead, self._was = teleoperator.parameters.dt, 1, 0.0, Mode.D
        self._places = [anchor.copy() for anchor in teleoperator.estimator.anchors]

    def sample(self, time):
        mode, foot, estimator = self._teleoperator.mode, self._foot, self._teleoperator.estimator
        if self._was.single and mode is Mode.D:
            self.steps, self._foot, self._ahead = self.steps - 1, 1 - foot, 0.0
        self._was, foot = mode, self._foot
        for k in (0, 1):
            self._places[k] = estimator.anchors[k].copy()
        if time > self._begin and self.steps > 0:
            self._lead(foot, estimator)
        left, right = (place.copy() for place in self._places)
        return OperatorSample(time, (TrackedPose.of(left), TrackedPose.of(right)))

    def _lead(self, foot, estimator):
        place, anchor = self._places[foot], estimator.anchors[foot]
        if not self._was.single:
            place[2] = anchor[2] + UP
            return
        self._ahead += self._dt * STICK
        place[0] = anchor[0] + min(self._ahead, FORWARD)
        over = max(0.0, self._ahead - FORWARD - STICK * 0.3) / STICK
        place[2] = max(anchor[2] + UP - LET_GO * over, anchor[2] - DOWN)


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "phase"), [("biped20", 0.0), ("g1", 0.0), ("g1", 0.013)])
def test_it_steps_again_as_soon_as_both_feet_stand(get_robot, robot, phase):
    devices = []

    def device(teleoperator):
        devices.append(Eager(teleoperator, phase, steps=3))
        return devices[0]

    plant = VELOCITY_TELEOP_PLANT.with_noise()
    run = run_teleop(get_robot(robot), device, plant, duration=12.0, seed=3)
    assert not run.fell
    assert devices[0].steps == 0
    # Both feet carry again, and nothing bounces.
    assert run.log.loads[-40:].sum(axis=1).max() < 1.5 * run.plant.robot.weight


BELOW = 0.03
"""Depth below the floor of the foot's goal [m]."""

LIFTED, LED, LOWERED = (1.0, 1.6), (2.0, 2.8), (3.5, 4.3)
"""From when to when the device goes up, ahead and down [s]."""


class Far:
    """Leads the right foot up, far away, and down; or is lost before it goes down."""

    def __init__(self, teleoperator, far, lost):
        self._left, self._right = (anchor.copy() for anchor in teleoperator.estimator.anchors)
        self._far, self._lost = np.array([*far, 0.0]), lost

    def sample(self, time):
        if self._lost and time > LOWERED[0]:
            return None
        up, led, down = (
            float(np.interp(time, when, (0.0, 1.0))) for when in (LIFTED, LED, LOWERED)
        )
        height = [0.0, 0.0, UP * up * (1.0 - down) - BELOW * down]
        right = self._right + led * self._far + height
        return OperatorSample(time, (TrackedPose.of(self._left), TrackedPose.of(right)))


@pytest.mark.slow
@pytest.mark.parametrize("lost", [False, True])
def test_it_lands_nearer(get_robot, lost):
    """The leg of TALOS that stands folds less deep than the other one would need."""
    robot = get_robot("talos")
    run = run_teleop(
        robot, lambda t: Far(t, (0.6, -0.15), lost), TORQUE_TELEOP_PLANT, duration=7.0, seed=3
    )
    log = run.log
    assert not run.fell
    stands = log.mode == tuple(Mode).index(Mode.D)
    in_the_air = ~stands & (log.time > LED[0]) & (log.time < LOWERED[0])
    assert np.ptp(log.soles[in_the_air, 1, 0]) > 0.4
    assert stands[log.time > LOWERED[1] + 1.5].all()
    assert np.ptp(log.soles[log.time > 6.5, :, 2], axis=0).max() < 0.005
