"""Devices that say how fast they move: what leads feet and hands lags less behind them."""

import math

import numpy as np
import pytest
from led_hands import Arms
from standing import aimed, devices, footing, steady, towards
from walker import sample

from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    RecordedDevice,
    read_recording,
    run_teleop,
    write_recording,
)
from poise.locomotion import Mode, OperatorGuard, OperatorSample, TrackedPose
from poise.locomotion._stepping._guard import Tracker, VelocityCheck

DT = 0.002
UP = np.array([0.1, 0.0, 0.2])
SOLES = [np.array([0.0, 0.135, 0.0]), np.array([0.0, -0.135, 0.0])]


def rates_after(rate, waits=0):
    """What a guard makes of a left device's velocity, so many ticks after it was told."""
    guard = OperatorGuard(dt=DT, low=0.02, press_depth=0.05)
    guard.check(sample(0.0, rates=(rate, None)), 0.0, SOLES, SOLES)
    found = guard.check(sample(DT, rates=(rate, None)), DT, SOLES, SOLES)
    for tick in range(waits):
        found = guard.check(None, (tick + 2) * DT, SOLES, SOLES)
    return tuple(part.velocity for part in found.feet)


def test_a_velocity_counts_for_a_tenth_of_a_second():
    for waits, known in ((0, True), (48, True), (52, False)):
        left, right = rates_after(UP, waits)
        assert right is None
        assert (left is not None) == known
    np.testing.assert_array_equal(rates_after(UP)[0], UP)


@pytest.mark.parametrize("bad", [(np.nan, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, np.inf, 0.0)], ids=str)
def test_what_no_hand_does_is_no_velocity_and_the_place_counts(bad):
    assert rates_after(np.array(bad)) == (None, None)


def told(claims, moves, period=DT, seconds=1.0):
    """The velocities that count of a device that claims one velocity and moves by another."""
    rate, found, place = VelocityCheck(), [], np.zeros(3)
    for k in range(round(seconds / period)):
        rate.update(tuple(claims(k * period)), tuple(place), k * period)
        found.append(rate.at(k * period))
        place = place + period * moves((k + 0.5) * period)
    return found


FAST = np.array([1.6, 0.0, 0.0])


@pytest.mark.parametrize("moves", [np.zeros(3), -FAST, FAST[[1, 0, 2]]], ids=str)
def test_a_velocity_with_which_the_device_does_not_move_counts_no_further_than_5_cm(moves):
    found = told(lambda time: FAST, lambda time: moves)
    counted = sum(rate is not None for rate in found)
    assert 0.0 < counted * DT * np.linalg.norm(FAST - moves) <= 0.06
    assert not any(rate is not None for rate in found[counted:])


@pytest.mark.parametrize("period", [DT, 1.0 / 30.0])
def test_a_velocity_with_which_it_moves_counts_also_as_it_turns_round(period):
    def moving(time):
        return FAST * math.sin(2.0 * math.pi * time)

    assert all(rate is not None for rate in told(moving, moving, period, 5.0))


def test_one_that_tells_the_truth_again_counts_again():
    found = told(lambda time: FAST if time < 0.3 else 0.0 * FAST, lambda time: 0.0 * FAST)
    assert found[100] is None
    assert found[-1] is not None


def sent(robot, lifted, where):
    """The velocity with which a foot is sent that is led from above where it stood."""
    now = steady(robot, mode=Mode.SL, lifted=lifted)
    ours = devices(robot)
    x, y, z = (now.anchors[1] + where).tolist()
    device = sample(0.0, right=(x, y, z), rates=(None, UP))
    place = aimed(ours, now, device)
    assert np.linalg.norm(place - [x, y, z]) < 1e-6 or not any(ours.rate)
    return list(ours.rate)


def test_a_foot_that_is_sent_where_the_device_is_goes_as_fast(get_robot):
    assert sent(get_robot("biped20"), 0.1, (0.02, 0.0, 0.1)) == UP.tolist()


@pytest.mark.parametrize(
    ("lifted", "where"), [(0.0, (0.02, 0.0, 0.1)), (0.1, (3.0, 0.0, 0.1))], ids=["touches", "far"]
)
def test_one_that_is_sent_elsewhere_does_not(get_robot, lifted, where):
    assert sent(get_robot("biped20"), lifted, where) == [0.0, 0.0, 0.0]


def test_the_velocity_is_added_to_what_leads_to_the_place(get_robot, monkeypatch):
    robot = get_robot("biped20")
    now = footing(robot, mode=Mode.SL, lifted=0.1)
    monkeypatch.setattr("poise.locomotion._stepping._feet._SWING_TIME", 1e-12)
    here = now.sole(1)
    above, fast = here + [0.0, 0.0, 0.01], tuple((100.0 * UP).tolist())
    still = towards(devices(robot), now, above, hurry=True)
    moving = towards(devices(robot), now, above, tuple(UP.tolist()), hurry=True)
    np.testing.assert_allclose(moving - still, UP, atol=1e-9)
    most = towards(devices(robot), now, here, fast, hurry=True)
    assert np.linalg.norm(most) <= math.sqrt(3.0) * 1.0 + 1e-9


def lag(robot, *, told, frequency=0.5):
    """How far a hand is from a place that swings by 8 cm, as a rule [m]."""
    arms = Arms(robot)
    start, omega, far = [h.copy() for h in arms.hands], 2.0 * math.pi * frequency, []
    for tick in range(1500):
        angle = omega * DT * tick
        place = start[0] + [0.0, 0.0, 0.04 * (1.0 - math.cos(angle))]
        rate = np.array([0.0, 0.0, 0.04 * omega * math.sin(angle)])
        arms.advance([place, start[1]], rates=[rate if told else None, None])
        far.append(np.linalg.norm(arms.hands[0] - place))
    assert not any(arms.each("blocked"))
    return float(np.sqrt(np.mean(np.square(far[300:]))))


def test_a_hand_lags_less_behind_a_device_that_says_how_fast_it_is(get_robot):
    robot = get_robot("humanoid33")
    assert lag(robot, told=True) < 0.3 * lag(robot, told=False)


def test_a_hand_is_no_faster_than_it_may_be_whatever_its_device_says(get_robot):
    robot = get_robot("humanoid33")
    arms = Arms(robot, speed_max=0.5)
    start, before = [h.copy() for h in arms.hands], arms.hands[0].copy()
    for _ in range(400):
        arms.advance([start[0] + [0.1, 0.0, 0.1], None], rates=[np.array([9.0, 0.0, 9.0]), None])
        assert np.linalg.norm(arms.hands[0] - before) < 1.1 * 0.5 * DT
        before = arms.hands[0].copy()


def test_an_open_clutch_has_no_velocity():
    hand = Tracker(DT)
    hand.update(TrackedPose.of(np.zeros(3), False, velocity=UP), 0.0)
    assert hand.velocity(0.0) is None
    hand.update(TrackedPose.of(np.zeros(3), True, velocity=UP), DT)
    np.testing.assert_array_equal(hand.velocity(DT), UP)


def test_velocities_are_recorded_and_come_back(tmp_path):
    hand = TrackedPose.of(np.zeros(3), True, velocity=-UP)
    told = sample(0.0, rates=(None, UP), hands=(hand, TrackedPose.of(np.ones(3), True)))
    odd = sample(DT, rates=(np.full(3, np.nan), None))
    said = enumerate((told, odd, sample(2 * DT)))
    write_recording(tmp_path / "x.mcap", said, robot="biped20", dt=DT)
    device = RecordedDevice(read_recording(tmp_path / "x.mcap"))
    first, second, third = (device.sample(tick * DT) for tick in range(3))
    assert first.feet[0].velocity is None
    np.testing.assert_array_equal(first.feet[1].velocity, UP)
    np.testing.assert_array_equal(first.hands[0].velocity, -UP)
    assert first.hands[1].velocity is None
    assert np.isnan(second.feet[0].velocity).all()
    assert second.feet[1].velocity is None
    assert [part.velocity for part in third.feet] == [None, None]


class Swinging:
    """A right foot that is lifted, and then swings forward and back; it may say how fast."""

    def __init__(self, teleoperator, *, told):
        (self._left, self._right), self._told = teleoperator.estimator.anchors, told

    def place(self, time):
        up, angle = min(max(2.0 * (time - 0.5), 0.0), 1.0), math.pi * max(time - 1.8, 0.0)
        return self._right + [0.05 * math.sin(angle), 0.0, 0.08 * up]

    def sample(self, time):
        rate = None
        if self._told:
            rate = (self.place(time + 1e-4) - self.place(time - 1e-4)) / 2e-4
        return sample(time, self._left, self.place(time), rates=(None, rate))


def foot_lag(robot, *, told):
    """How far the foot is from its device, as a rule [m]."""
    made = []

    def device(teleoperator):
        made.append(Swinging(teleoperator, told=told))
        return made[0]

    run = run_teleop(robot, device, TORQUE_TELEOP_PLANT.with_noise(), duration=4.5)
    assert not run.fell
    log, late = run.log, run.log.time > 2.5
    asked = np.array([made[0].place(time)[0] for time in log.time[late]])
    return float(np.sqrt(np.mean((log.soles[late, 1, 0] - asked) ** 2)))


class Claiming:
    """A right foot that is held up ahead, and claims to go on."""

    def __init__(self, teleoperator):
        self._left, self._right = teleoperator.estimator.anchors

    def sample(self, time):
        up, ahead = min(max(2.0 * (time - 0.5), 0.0), 1.0), min(max(time - 1.8, 0.0), 1.0)
        place = self._right + [0.2 * ahead, 0.0, 0.1 * up]
        rate = np.array([2.4, 0.0, 0.0]) if time > 3.0 else None
        return sample(time, self._left, place, rates=(None, rate))


def test_a_foot_stays_where_its_device_is_whatever_that_claims(get_robot):
    run = run_teleop(get_robot("biped20"), Claiming, TORQUE_TELEOP_PLANT, duration=4.0)
    assert not run.fell
    log = run.log
    off = log.soles[:, 1, 0] - log.target[:, 0]
    assert np.abs(off[(log.time > 3.0) & log.when(Mode.SL)]).max() < 0.07


@pytest.mark.slow
def test_a_foot_lags_less_behind_a_device_that_says_how_fast_it_is(get_robot):
    robot = get_robot("g1")
    assert foot_lag(robot, told=True) < 0.5 * foot_lag(robot, told=False)


def test_a_device_may_write_over_what_it_has_given(get_robot):
    """Its tracker goes out of sight: place and velocity in the same memory are no numbers now."""
    place, rate, hand = np.zeros(3), np.zeros(3), np.zeros(3)

    def device(teleoperator):
        left, right = teleoperator.estimator.anchors

        class Reusing:
            def sample(self, time):
                place[:] = right + [0.0, 0.0, min(max(0.4 * (time - 0.1), 0.0), 0.08)]
                rate[:] = hand[:] = (0.0, 0.0, 0.4)
                if time > 0.6:
                    place[:] = rate[:] = hand[:] = np.nan
                held = TrackedPose(hand, time > 0.02, velocity=rate)
                feet = TrackedPose.of(left), TrackedPose(place, velocity=rate)
                return OperatorSample(time, feet, hands=(held, held))

        return Reusing()

    run = run_teleop(get_robot("biped20"), device, TORQUE_TELEOP_PLANT, duration=0.9)
    assert not run.fell
    assert len(run.log.entries(Mode.SL)) == 1
    assert run.teleoperator.device_error is None
    assert np.isfinite(run.log.command).all()
