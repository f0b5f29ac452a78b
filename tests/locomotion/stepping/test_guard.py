"""Samples of a device that reach the controller, and those that do not."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from msgspec import structs
from walker import sample

from poise.errors import ConfigurationError
from poise.locomotion import DeviceStatus, OperatorGuard

SOLES = (np.array([0.0, 0.135, 0.0]), np.array([0.0, -0.135, 0.0]))
"""Where the feet stand [m]."""
DT = 0.005
SPEED, START, LOW, PRESS = 2.5, 0.06, 0.01, 0.08


def guard(**changes):
    return OperatorGuard(**{"dt": DT, "low": LOW, "press_depth": PRESS} | changes)


def check(guard, sample, time):
    return guard.check(sample, time, SOLES, SOLES)


def same(followed, sample):
    return [followed.place(foot) for foot in (0, 1)] == [sample.place(foot) for foot in (0, 1)]


def held(time=0.0):
    """A guard whose devices hold their feet from a time on."""
    made = guard()
    check(made, sample(time), time)
    assert made.status is DeviceStatus.OK
    return made


@pytest.mark.parametrize(
    "bad",
    [
        sample(1.0, left=(np.nan, 0.0, 0.0)),
        sample(1.0, right=(np.inf, 0.0, 0.0)),
        sample(np.nan),
        sample(-1.0),
        sample(1.0),
        sample(0.005, left=(0.0, 0.5, 0.0)),
    ],
    ids=["nan", "infinite", "nan time", "older", "far ahead", "jump"],
)
@pytest.mark.filterwarnings("ignore")
def test_a_bad_sample_is_refused_and_the_last_good_one_holds(bad):
    made, good = guard(), sample(0.0)
    check(made, good, 0.0)
    assert same(check(made, bad, DT), good)
    assert made.status is DeviceStatus.REFUSED


def test_one_bad_device_does_not_hold_up_the_other():
    made = held()
    up = sample(DT, left=(np.nan, 0.0, 0.0), right=(0.0, -0.135, 0.01))
    assert check(made, up, DT).place(1)[2] == 0.01


def test_silence_is_stale_then_lost():
    made, good = guard(), sample(0.0)
    check(made, good, 0.0)
    assert same(check(made, None, 0.4), good)
    assert made.status is DeviceStatus.STALE
    assert check(made, None, 0.6) is None
    assert made.status is DeviceStatus.LOST


def test_between_two_samples_of_a_device_nothing_changes():
    """At 100 Hz there is one in five ticks; what became of it holds meanwhile."""
    made, said = held(), []
    for tick in range(1, 100):
        time = tick * DT
        bad = (np.nan, 0.0, 0.0) if 40 <= tick < 60 else (0.0, 0.135, 0.0)
        check(made, sample(time, left=bad) if tick % 5 == 0 else None, time)
        said.append(made.status)
    assert said == [DeviceStatus.OK] * 39 + [DeviceStatus.REFUSED] * 20 + [DeviceStatus.OK] * 40
    for tick in range(100, 140):
        check(made, None, tick * DT)
        said.append(made.status)
    assert DT * (said.index(DeviceStatus.STALE) + 1 - 95) == pytest.approx(0.1, abs=1.5 * DT)


@pytest.mark.parametrize(
    "elsewhere", [(0.0, 0.135, 0.1), (1.0, 0.135, 0.0), (0.0, 0.135, 0.02)], ids=str
)
def test_a_device_that_is_found_again_takes_hold_only_where_its_foot_is(elsewhere):
    made = held()
    assert check(made, None, 0.6) is None
    found = check(made, sample(0.7, left=elsewhere), 0.7)
    assert made.status is DeviceStatus.WAITING
    # Straight below the foot, which is where a foot goes that nobody holds.
    np.testing.assert_allclose(found.place(0), SOLES[0] - [0.0, 0.0, PRESS], atol=1e-12)
    assert check(made, sample(0.705), 0.705) is not None
    assert made.status is DeviceStatus.OK
    assert check(made, sample(0.71, left=(0.0, 0.135, 0.012)), 0.71).place(0)[2] == 0.012


@pytest.mark.parametrize(("speed", "rate"), [(2.0, 13.0), (2.0, 200.0), (1.0, 5.0), (2.4, 60.0)])
def test_what_a_hand_does_is_followed_at_any_rate(speed, rate):
    made, highest, due = held(0.1), 0.0, 0.1
    for tick in range(21, 221):
        said = None
        if tick * DT >= due - 1e-9:
            height = speed * abs((tick * DT + 0.4) % 1.0 - 0.5)
            said, due = sample(tick * DT, left=(0.0, 0.135, height)), due + 1.0 / rate
        highest = max(highest, check(made, said, tick * DT).place(0)[2])
        assert made.status is not DeviceStatus.REFUSED
    assert highest > 0.5 * speed - speed / rate - 1e-9


@pytest.mark.parametrize("ahead", [0.6, 3600.0, 1e9, -0.3, -3600.0])
def test_a_clock_that_jumps_locks_nobody_out(ahead):
    made = held()
    followed = [check(made, sample(tick * DT + ahead), tick * DT) for tick in range(1, 150)]
    assert all(same(place, sample(0.0)) for place in followed if place is not None)
    assert followed[-1] is not None
    assert made.status is DeviceStatus.OK


@pytest.mark.parametrize("slower", [5e-4, 0.02, 0.5])
def test_what_comes_later_and_later_is_followed_for_so_long_only(slower):
    """Clocks drift; a link that is choked delivers all of it, but an age after it was sent."""
    made, up, led = held(), (0.0, 0.135, 0.1), []
    for tick in range(1, 10_000):
        found = check(made, sample(tick * DT / (1.0 + slower), left=up), tick * DT)
        led.append(found is not None and found.place(0)[2] == 0.1)
    begun = led.index(True)
    gone = next((k for k in range(begun, len(led)) if not led[k]), None)
    if slower == 5e-4:
        assert gone is None
        return
    # Half a second late, and half a second of silence until the device counts as lost.
    assert gone * DT * slower / (1.0 + slower) < 1.1
    assert not any(led[gone:])
    assert made.status is not DeviceStatus.OK


def test_a_robot_whose_clock_goes_back_lets_go_and_takes_hold_again():
    """A plant that is reset, say: the hands' clock goes back with it, or does not."""
    for stamp in (0.0, 10.0):
        made = guard()
        for tick in range(40):
            check(made, sample(10.0 + tick * DT), 10.0 + tick * DT)
        assert made.status is DeviceStatus.OK
        assert check(made, sample(stamp + DT), 0.0) is None
        for tick in range(1, 10):
            found = check(made, sample(stamp + (tick + 1) * DT), tick * DT)
        assert made.status is DeviceStatus.OK
        assert same(found, sample(0.0))
        for tick in range(10, 120):
            check(made, None, tick * DT)
        assert made.status is DeviceStatus.LOST


def stream(seed, loss, late):
    """What comes before each tick: lost, late, out of order, wrongly stamped, from elsewhere."""
    rng = np.random.default_rng(seed)
    hand, sent, clock = SOLES[0].copy(), [], 0.0
    silent_until = 0.0
    for tick in range(400):
        time = tick * DT
        chance = rng.random()
        if chance < 0.01:
            clock += float(rng.choice([-1e3, -1.0, 1.0, 1e9]))
        elif chance < 0.02:
            hand = rng.uniform(-3.0, 3.0, 3)
        elif chance < 0.03:
            silent_until = time + rng.uniform(0.0, 1.0)
        elif chance < 0.05:
            hand = SOLES[0].copy()
        hand = hand + rng.normal(0.0, rng.choice([0.001, 0.01, 0.1]), 3)
        if time < silent_until or rng.random() < loss:
            continue
        place = tuple(hand) if rng.random() < 0.95 else (np.nan, 1e300, -np.inf)
        sent.append((time + rng.uniform(0.0, 1.0) * late, sample(time + clock, left=place)))
    arrivals = {}
    for at, what in sorted(sent, key=lambda pair: pair[0]):
        arrivals[round(at / DT)] = what
    return arrivals


@given(
    seed=st.integers(0, 2**32 - 1),
    loss=st.sampled_from((0.0, 0.3, 0.95)),
    late=st.sampled_from((0.0, 0.05, 0.3)),
)
@settings(
    deadline=None, max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_no_stream_of_samples_makes_a_jump_or_locks_the_operator_out(seed, loss, late):
    arrivals = stream(seed, loss, late)
    made, before, heard, gone = guard(), None, -1.0, 0.0
    for tick in range(480):
        time = tick * DT
        if tick in arrivals:
            heard = time
        found = check(made, arrivals.get(tick), time)
        left = None if found is None or found.place(0)[2] == -PRESS else found.place(0)
        if left is not None:
            assert np.isfinite(left).all()
            gone += np.linalg.norm(np.subtract(left, SOLES[0] if before is None else before))
            assert gone <= START + 1e-9
            assert time - heard <= 0.5 + 1e-9
        # As in a bucket that empties at the largest speed.
        before, gone = left, max(0.0, gone - SPEED * DT)
    # Whatever came: a second of good samples, and the operator leads.
    for tick in range(480, 700):
        found = check(made, sample(tick * DT), tick * DT)
    assert same(found, sample(0.0))
    assert made.status is DeviceStatus.OK


@pytest.mark.parametrize("option", ["dt", "low", "press_depth"])
def test_a_guard_that_guards_nothing_is_refused(option):
    with pytest.raises(ConfigurationError, match=option):
        guard(**{option: 0.0})


def test_a_source_that_is_frozen_is_lost_and_makes_nobody_walk():
    """Its newest sample, again and again, is no news, however long nothing else has come."""
    made, last = held(), structs.replace(sample(0.205), velocity=(0.3, 0.0, 0.0))
    velocities, statuses = [], []
    for tick in range(1, 1000):
        check(made, last if tick > 40 else sample(tick * DT), tick * DT)
        velocities.append(made.velocity)
        statuses.append(made.status)
    assert velocities[60] == (0.3, 0.0, 0.0)
    assert set(velocities[40 + 102 :]) == {(0.0, 0.0, 0.0)}
    assert set(statuses[40 + 102 :]) == {DeviceStatus.LOST}
    # A clock that has jumped is another one.
    for tick in range(1000, 1010):
        check(made, sample(7.0 + tick * DT), tick * DT)
    assert made.status is DeviceStatus.OK


AHEAD, STILL = (0.3, 0.0, 0.0), (0.0, 0.0, 0.0)


def walks(guard, velocity, time):
    """The velocity that counts after a sample with one."""
    check(guard, structs.replace(sample(time), velocity=velocity), time)
    return guard.velocity


def test_a_stick_that_was_held_when_the_device_was_found_has_to_be_let_go_first():
    made = guard()
    for time in (0.0, 0.1):
        assert walks(made, AHEAD, time) == STILL
    assert walks(made, STILL, 0.2) == STILL
    assert walks(made, AHEAD, 0.3) == AHEAD
    # Nothing comes for a while: the robot stands, and goes on standing when the stick is back.
    check(made, None, 0.9)
    assert made.velocity == STILL
    for time in (1.0, 1.1):
        assert walks(made, AHEAD, time) == STILL
    assert walks(made, STILL, 1.2) == STILL
    assert walks(made, AHEAD, 1.3) == AHEAD


@pytest.mark.parametrize("velocity", [(1e-9, 0.0, 0.0), (0.0, -0.008, 0.0), (0.008, 0.0, -0.015)])
def test_a_stick_that_does_not_rest_at_exactly_zero_asks_for_nothing(velocity):
    made = guard()
    for time in (0.0, 0.1, 0.2):
        assert walks(made, velocity, time) == STILL
    assert walks(made, AHEAD, 0.3) == AHEAD
    assert walks(made, velocity, 0.4) == STILL


def test_a_velocity_that_is_no_number_any_more_ends_within_half_a_second():
    made = guard()
    assert walks(made, STILL, 0.0) == STILL
    assert walks(made, AHEAD, 0.1) == AHEAD
    lost = (math.nan, 0.0, 0.0)
    velocities = [walks(made, lost, 0.1 + 0.05 * k) for k in range(1, 20)]
    assert velocities[:9] == [AHEAD] * 9
    assert velocities[11:] == [STILL] * 8
    assert walks(made, AHEAD, 1.2) == STILL
    assert walks(made, STILL, 1.25) == STILL
    assert walks(made, AHEAD, 1.3) == AHEAD
