"""Arms with force feedback: what a hand feels of a foot, and what it never feels."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from poise.apps.teleoperation import (
    VELOCITY_TELEOP_PLANT,
    HapticArm,
    HapticDriver,
    HapticFeet,
    SimulatedArm,
    run_teleop,
)
from poise.dynamics import RobotState, least_jerk
from poise.errors import ConfigurationError
from poise.locomotion import Mode, StepTeleoperator

HOME = np.array([0.4, 0.0, 0.1])
"""Where a hand rests, in its own frame [m]."""
STANDING, LANDING = [[0.0, 0.0, 300.0]] * 2, [[0.0, 0.0, 300.0], [10.0, 0.0, 200.0]]
IN_AIR = [[0.0, 0.0, 600.0], [0.0, 0.0, 0.0]]
MOST, ROUNDING = 6.0, 1e-12


def still(time):
    del time
    return HOME, True


class Arm:
    """One that is where it is, and notes what it is told."""

    def __init__(self, clutch=True):
        self.clutch, self.there, self.forces = clutch, True, []
        self.place = HOME

    def read(self):
        return (self.place, self.clutch) if self.there else None

    def write(self, force):
        self.forces.append(force.copy())

    @property
    def norms(self):
        return np.linalg.norm(self.forces, axis=1)


def driven(*stages, arm=None, **settings):
    """What the right hand is pushed by, each stage 0.3 s of the feet's forces, None for silence."""
    arm = arm or Arm()
    arm.driver = driver = HapticDriver(Arm(), arm, **settings)
    for number, feet in enumerate(stages):
        for tick in range(300):
            now = 0.3 * number + 1e-3 * tick
            if feet is not None:
                driver.feel(feet, now)
            driver.tick(now)
    return arm


@pytest.fixture
def device(get_robot, monkeypatch):
    """Two arms as a device, whose clutches are open, on a machine whose clock stands still."""
    monkeypatch.setattr("poise.apps.teleoperation._haptics.clock.monotonic", lambda: 100.0)
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation="velocity")
    arms = Arm(clutch=False), Arm(clutch=False)
    device = teleoperator.device = HapticFeet(HapticDriver(*arms), teleoperator)
    device.arms, device.teleoperator = arms, teleoperator
    return device


def test_a_landing_is_felt_smoothly_is_bounded_and_fades():
    arm = driven(STANDING, IN_AIR, LANDING, LANDING, LANDING, LANDING, gain=0.1)
    force = np.array(arm.forces)
    assert np.abs(force[:600]).max() == 0.0
    landing = force[600:]
    assert MOST * 0.9 < arm.norms.max() <= MOST + ROUNDING
    # Up and forward, as the ground pushes the foot.
    strongest = landing[np.argmax(landing[:, 2])]
    assert strongest[2] > 0.0
    assert strongest[0] == pytest.approx(0.05 * strongest[2], rel=0.01)
    # A period's change is at most what the smoothing lets through.
    assert np.linalg.norm(np.diff(force, axis=0), axis=1).max() <= MOST * 1e-3 / 0.01
    assert arm.norms[-1] == 0.0
    # Nor is it pushed while its clutch is open.
    open_arm = driven(STANDING, IN_AIR, LANDING, arm=Arm(clutch=False))
    assert isinstance(open_arm, HapticArm)
    assert open_arm.norms.max() == 0.0


def test_what_a_foot_hits_in_the_air_is_felt_as_long_as_it_does():
    arm = driven(STANDING, IN_AIR, [[0.0, 0.0, 600.0], [-150.0, 0.0, 0.0]])
    assert arm.forces[-1] == pytest.approx([-1.5, 0.0, 0.0], abs=2e-3)


@pytest.mark.parametrize(
    "clock", [lambda now: now, lambda now: 0.6, lambda now: now - 50.0, lambda now: np.nan]
)
def test_a_robot_that_falls_silent_pushes_no_hand_whatever_the_clock_says(clock):
    arm = driven(STANDING, IN_AIR, [[0.0, 0.0, 600.0], [-150.0, 0.0, 0.0]])
    driver, now = arm.driver, 0.9
    assert arm.norms[-1] > 1.0
    for tick in range(200):
        driver.tick(clock(now + 1e-3 * tick))
    assert arm.norms[-1] == 0.0
    if clock(now) == now:
        # 0.1 s of patience, then as smoothly as it came.
        assert arm.norms[900 + 95] > 1.0
        assert np.abs(np.diff(arm.norms)).max() <= MOST * 1e-3 / 0.01


class Fails(Arm):
    """One that fails while a fault is named."""

    fault = ""

    def read(self):
        if self.fault == "read":
            raise OSError("the cable is out")
        return (HOME + np.nan, True) if self.fault == "nowhere" else super().read()

    def write(self, force):
        super().write(force)
        if self.fault == "write":
            raise OSError("the cable is out")


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("fault", ["read", "write", "nowhere"])
def test_an_arm_that_fails_is_gone_and_the_other_goes_on(fault, side, caplog):
    fails, other = Fails(), Arm()
    driver = HapticDriver(*((fails, other) if side == 0 else (other, fails)))
    air, landing = (feet if side == 1 else feet[::-1] for feet in (IN_AIR, LANDING))
    for tick in range(350):
        # Rubbish from the robot is no news.
        driver.feel([[float("nan")] * 3] * 2, 1e-3 * tick)
        driver.feel(air if tick < 200 else landing, 1e-3 * tick)
        fails.fault = fault if tick >= 225 else ""
        readings = driver.tick(1e-3 * tick)
        assert (readings[side] is None) == (tick >= 225)
        assert readings[1 - side] is not None
    assert fails.norms[:225].max() > 0.5
    if fault != "write":
        assert fails.norms[225:].max() == 0.0
    assert len(other.forces) == 350
    raised = [] if fault == "nowhere" else ["the cable is out"]
    assert [str(error) for error in driver.errors if error is not None] == raised
    said = [f"the {('left', 'right')[side]} arm failed, and counts as gone" for _ in raised]
    assert [record.getMessage() for record in caplog.records] == said
    # It is back, and pushed as softly as at the beginning.
    fails.fault = ""
    assert None not in driver.tick(0.35)
    assert driver.errors == (None, None)
    assert fails.norms[-1] < 0.3


@pytest.mark.parametrize("dt", [1e-3, 0.2])
def test_hands_that_nobody_reads_any_more_lead_nothing(device, monkeypatch, dt):
    now, driver = 100.0, device.driver
    monkeypatch.setattr("poise.apps.teleoperation._haptics.clock.monotonic", lambda: now)
    driver.dt = dt
    device.sample(0.0)
    # A tenth of a second, or two periods.
    now += max(0.1, 2.0 * dt) - 1e-3
    assert None not in driver.readings
    now += 2e-3
    assert driver.readings == (None, None)
    # A simulated robot on a slow computer keeps its hands.
    assert device.sample(0.005) is not None


def test_what_cannot_be_is_refused():
    with pytest.raises(ConfigurationError, match="two feet.*two rows"):
        HapticDriver(Arm(), Arm()).feel([[1.0, 2.0]], 0.0)
    with pytest.raises(ConfigurationError, match="force_max"):
        HapticDriver(Arm(), Arm(), force_max=0.0)


def test_a_hand_gives_way_like_a_spring():
    arm = SimulatedArm(still, stiffness=200.0)
    arm.write(np.array([0.0, 0.0, 2.0]))
    for _ in range(3000):
        position, clutch = arm.read()
    assert clutch
    assert position == pytest.approx(HOME + [0.0, 0.0, 0.01], abs=1e-6)


class Noted(SimulatedArm):
    """A simulated arm with a diary: height of the hand, force upwards, period by period."""

    def __init__(self, hand):
        super().__init__(hand)
        self.diary = []

    def write(self, force):
        super().write(force)
        self.diary.append((float(self._position[2] - HOME[2]), *force.tolist()))


def step(time):
    """A hand that lifts 8 cm from 0.8 s on, goes 10 cm ahead, and comes down slowly."""
    up = least_jerk(time, 0.8, 1.2)[0] - least_jerk(time, 3.2, 1.6)[0]
    ahead = least_jerk(time, 2.0, 1.0)[0]
    return HOME + [0.1 * ahead, 0.0, 0.08 * up], time > 0.1


def test_the_hand_feels_the_ground_when_the_foot_lands(get_robot):
    arms = Noted(lambda time: (HOME, time > 0.1)), Noted(step)
    run = run_teleop(
        get_robot("biped20"),
        lambda t: HapticFeet(HapticDriver(*arms), t),
        VELOCITY_TELEOP_PLANT,
        duration=6.5,
    )
    left, right = (np.array(arm.diary) for arm in arms)
    assert not run.fell
    time = 1e-3 * np.arange(len(right))
    (lifted,), landed = run.log.entries(Mode.SL), run.log.entries(Mode.D)[-1]
    assert run.log.soles[-1, 1, 0] - run.log.soles[0, 1, 0] > 0.06
    # Nothing before, nothing to speak of in the air, then a push upwards that fades.
    assert np.abs(right[time < lifted - 0.1, 1:]).max() == 0.0
    flight = (time > lifted + 0.3) & (time < landed - 0.1)
    assert np.abs(right[flight, 1:]).max() < 0.3
    landing = (time > landed - 0.1) & (time < landed + 0.3)
    assert right[landing, 3].max() > 1.0
    assert np.linalg.norm(right[:, 1:], axis=1).max() <= MOST + ROUNDING
    assert np.abs(right[-100:, 1:]).max() < 0.2
    # The hand of the foot that stood all the time felt nothing.
    assert np.abs(left[:, 1:]).max() == 0.0


def test_arms_may_speak_in_lists_and_other_numbers(device):
    device.sample(0.0)
    for arm, place in zip(device.arms, ([1.0, 0, 0], np.float32([1, 0, 0.25])), strict=True):
        arm.place, arm.clutch = place, 1
    device.sample(0.005)
    for (place, clutch), up in zip(device.driver.readings, (0.0, 0.25), strict=True):
        np.testing.assert_array_equal(place, [1.0, 0.0, up])
        assert place.dtype == np.float64
        assert clutch is True
    assert device.driver.errors == (None, None)


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ((np.zeros(2), True), "Expected `array` of length 3, got 2"),
        ((HOME, "closed"), "Expected `bool | int`, got `str`"),
        (HOME, "Expected `array` of length 2, got 3"),
    ],
)
def test_what_is_no_reading_is_said_by_the_device(device, answer, words, side):
    arms, teleoperator = device.arms, device.teleoperator
    state = RobotState(teleoperator.robot.q_home, np.zeros(teleoperator.robot.nv))
    teleoperator.lead(teleoperator.estimator.update(state))
    assert teleoperator.device_error is None
    arms[side].read = lambda: answer
    teleoperator.lead(teleoperator.estimator.update(replace(state, time=0.005)))
    error = teleoperator.device_error
    assert isinstance(error, TypeError)
    assert str(error) == f"reading of {('left', 'right')[side]} arm: {words}"
    assert device.driver.readings[side] is None
    assert device.driver.readings[1 - side] is not None
    # It is told to let go.
    assert arms[side].norms[-1] == 0.0


@pytest.mark.parametrize("gone", [0, 1])
def test_an_arm_that_is_gone_lets_go_of_its_own_foot_alone(device, gone):
    arms = device.arms
    device.sample(0.0)
    for arm in arms:
        arm.clutch = True
    device.sample(0.005)

    def heights(time, by):
        for arm in arms:
            arm.place = HOME + [0.0, 0.0, by]
        sample = device.sample(time)
        places = zip(map(sample.place, (0, 1)), device.teleoperator.estimator.anchors, strict=True)
        return [round(float(place[2] - anchor[2]), 9) for place, anchor in places]

    assert heights(0.01, 0.05) == [0.05, 0.05]
    arms[gone].there = False
    # The other one is led on, without being let go in between.
    assert heights(0.015, 0.08) == ([0.0, 0.08] if gone == 0 else [0.08, 0.0])
    arms[1 - gone].there = False
    assert device.sample(0.02) is None


@pytest.mark.parametrize("to", [0.0, 1.7e9])
def test_arms_go_on_where_the_robots_clock_jumps_to(device, to):
    arms = device.arms
    for tick in range(20):
        device.sample(3.0 + 0.005 * tick)
    before = len(arms[0].forces)
    for tick in range(20):
        device.sample(to + 0.005 * tick)
    assert len(arms[0].forces) - before == pytest.approx(96, abs=1)
