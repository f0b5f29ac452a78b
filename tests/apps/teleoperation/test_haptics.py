"""Arms with force feedback: what a hand feels of a foot, and what it never feels."""

import threading
import time as clock
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
from poise.sim import Block

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
    driver = HapticDriver(Arm(), arm, **settings)
    for number, feet in enumerate(stages):
        for tick in range(300):
            now = 0.3 * number + 1e-3 * tick
            if feet is not None:
                driver.feel(feet, now)
            driver.tick(now)
    return arm


def test_arms_are_what_a_driver_has_to_have():
    assert isinstance(SimulatedArm(still), HapticArm)
    assert isinstance(Arm(), HapticArm)


def test_a_foot_that_stands_is_not_felt():
    assert driven(STANDING).norms.max() == 0.0


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


def test_what_a_foot_hits_in_the_air_is_felt_as_long_as_it_does():
    arm = driven(STANDING, IN_AIR, [[0.0, 0.0, 600.0], [-150.0, 0.0, 0.0]])
    assert arm.forces[-1] == pytest.approx([-1.5, 0.0, 0.0], abs=2e-3)


def test_a_robot_that_falls_silent_pushes_no_hand():
    arm = driven(STANDING, IN_AIR, LANDING, None)
    assert arm.norms[899] > 0.5
    # 0.1 s of patience, then as smoothly as it came.
    assert arm.norms[900 + 99] > 0.3
    assert arm.norms[-1] == 0.0


@pytest.mark.parametrize("clock", [lambda now: 0.6, lambda now: now - 50.0, lambda now: np.nan])
def test_a_robot_that_falls_silent_pushes_no_hand_whatever_the_clock_says(clock):
    arm = Arm()
    driver = HapticDriver(Arm(), arm)
    for tick in range(600):
        driver.feel(IN_AIR if tick < 300 else [[0.0, 0.0, 600.0], [-150.0, 0.0, 0.0]], 1e-3 * tick)
        driver.tick(1e-3 * tick)
    assert arm.norms[-1] > 1.0
    for tick in range(600, 800):
        driver.tick(clock(1e-3 * tick))
    assert arm.norms[-1] == 0.0


def test_an_open_clutch_is_not_pushed():
    assert driven(STANDING, IN_AIR, LANDING, arm=Arm(clutch=False)).norms.max() == 0.0


def test_an_arm_that_is_gone_is_told_to_let_go_and_the_other_goes_on():
    arms = Arm(), Arm()
    driver = HapticDriver(*arms)
    arms[1].there = False
    for tick in range(50):
        driver.feel(IN_AIR if tick < 25 else LANDING, 1e-3 * tick)
        driver.tick(1e-3 * tick)
    assert driver.readings[0] is not None
    assert driver.readings[1] is None
    assert arms[1].norms.max() == 0.0


class Fails(Arm):
    """One whose driver raises in a call while it is named."""

    def __init__(self, call=""):
        super().__init__()
        self.call = call

    def read(self):
        if self.call == "read":
            raise OSError("the cable is out")
        return super().read()

    def write(self, force):
        super().write(force)
        if self.call == "write":
            raise OSError("the cable is out")


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("call", ["read", "write"])
def test_an_arm_that_raises_is_gone_and_the_other_goes_on(call, side, caplog):
    fails, other = Fails(), Arm()
    driver = HapticDriver(*((fails, other) if side == 0 else (other, fails)))
    air, landing = (feet if side == 0 else feet[::-1] for feet in (IN_AIR, LANDING))
    for tick in range(350):
        driver.feel(air if tick < 200 else landing, 1e-3 * tick)
        fails.call = call if tick >= 100 else ""
        driver.tick(1e-3 * tick)
        assert (driver.readings[side] is None) == (tick >= 100)
        assert driver.readings[1 - side] is not None
    assert str(driver.errors[side]) == "the cable is out"
    assert driver.errors[1 - side] is None
    (said,) = (record.getMessage() for record in caplog.records)
    assert said == f"the {('left', 'right')[side]} arm failed, and counts as gone"
    assert other.norms[-1] > 0.5
    # It is back.
    fails.call = ""
    driver.tick(0.35)
    assert None not in driver.readings
    assert driver.errors == (None, None)


def test_the_foot_of_an_arm_that_does_not_take_its_force_is_felt_softly_when_it_is_back():
    arms = Arm(), Fails()
    driver = HapticDriver(*arms)
    for tick in range(350):
        driver.feel(IN_AIR if tick < 200 else LANDING, 1e-3 * tick)
        arms[1].call = "write" if tick >= 200 else ""
        driver.tick(1e-3 * tick)
    assert arms[1].norms.max() < 0.3


def test_hands_that_no_thread_reads_any_more_lead_nothing():
    driver, ended = HapticDriver(Arm(), Arm()), threading.Event()

    def serve():
        while not ended.wait(1e-3):
            driver.tick(clock.monotonic())

    thread = threading.Thread(target=serve)
    thread.start()
    while driver.readings[0] is None:
        clock.sleep(1e-3)
    ended.set()
    thread.join()
    clock.sleep(0.15)
    assert driver.readings == (None, None)
    driver.tick(clock.monotonic())
    assert None not in driver.readings


def test_arms_slower_than_ten_a_second_are_read():
    driver = HapticDriver(Arm(), Arm(), dt=0.2)
    driver.tick(0.0)
    clock.sleep(0.15)
    assert None not in driver.readings


def test_a_simulated_robot_on_a_slow_computer_keeps_its_hands(get_robot):
    arms = Arm(clutch=False), Arm(clutch=False)
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation="velocity")
    device = HapticFeet(HapticDriver(*arms, dt=0.1), teleoperator)
    device.sample(0.0)
    clock.sleep(0.25)
    assert device.driver.readings == (None, None)
    assert device.sample(0.005) is not None


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_an_arm_that_says_it_is_nowhere_is_told_to_let_go_at_once(bad):
    arms = Arm(), Arm()
    driver = HapticDriver(*arms)
    for tick in range(325):
        driver.feel(STANDING if tick < 150 else IN_AIR if tick < 300 else LANDING, 1e-3 * tick)
        driver.tick(1e-3 * tick)
    assert arms[1].norms[-1] > 0.5
    arms[1].place = np.array([0.4, bad, 0.1])
    driver.tick(0.325)
    assert arms[1].norms[-1] == 0.0
    assert driver.readings[0] is not None
    assert driver.readings[1] is None
    for tick in range(326, 400):
        driver.feel(LANDING, 1e-3 * tick)
        driver.tick(1e-3 * tick)
    # It is back, and pushed as softly as at the beginning.
    arms[1].place = HOME
    driver.tick(0.4)
    assert 0.0 < arms[1].norms[-1] < 0.3
    assert driver.readings[1] is not None


def test_an_arm_that_says_it_is_nowhere_leads_nothing_until_its_clutch_was_open(get_robot):
    arms = Arm(clutch=False), Arm(clutch=False)
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation="velocity")
    device = HapticFeet(HapticDriver(*arms), teleoperator)
    device.sample(0.0)
    arms[1].clutch = True
    foot = np.array(device.sample(0.005).place(1))
    arms[1].place = np.full(3, np.nan)
    assert np.array(device.sample(0.01).place(1)) == pytest.approx(foot)
    arms[1].place = HOME + [0.0, 0.0, 0.05]
    device.sample(0.015)
    arms[1].place = HOME + [0.0, 0.0, 0.1]
    assert np.array(device.sample(0.02).place(1)) == pytest.approx(foot)


def test_rubbish_from_the_robot_is_no_news():
    driver = HapticDriver(Arm(), Arm())
    driver.feel(IN_AIR, 0.0)
    driver.feel([[np.nan, 0.0, 1.0], [0.0, 0.0, np.inf]], 0.01)
    driver.tick(0.02)
    with pytest.raises(ConfigurationError, match="two feet.*two rows"):
        driver.feel([[1.0, 2.0]], 0.0)
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


def walked(robot, plant):
    """A run that is led by arms, and the right arm."""
    arms = Noted(lambda time: (HOME, time > 0.1)), Noted(step)
    run = run_teleop(robot, lambda t: HapticFeet(HapticDriver(*arms), t), plant, duration=6.5)
    return run, np.array(arms[1].diary), np.array(arms[0].diary)


def test_the_hand_feels_the_ground_when_the_foot_lands(get_robot):
    run, right, left = walked(get_robot("biped20"), VELOCITY_TELEOP_PLANT)
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


@pytest.mark.slow
def test_a_block_is_felt_sooner_than_the_ground(get_robot):
    robot = get_robot("biped20")
    # Under the right foot at the end of its way, and ahead of where it starts.
    block = Block(center=(0.36, -0.135), size=(0.4, 0.24, 0.03))
    felt, heights = [], []
    for plant in (VELOCITY_TELEOP_PLANT, replace(VELOCITY_TELEOP_PLANT, blocks=(block,))):
        run, right, _ = walked(robot, plant)
        assert not run.fell
        felt.append(1e-3 * np.argmax(right[:, 3] > 0.5))
        heights.append(run.log.soles[np.searchsorted(run.log.time, felt[-1]), 1, 2])
    assert felt[1] < felt[0] - 0.1
    assert heights[1] - heights[0] > 0.02


def test_a_clutch_that_was_not_seen_open_leads_nothing(get_robot):
    arms = Arm(), Arm()
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation="velocity")
    device, now = HapticFeet(HapticDriver(*arms), teleoperator), 0.0

    def moved(by, clutch):
        nonlocal now
        now += 0.005
        arms[1].place, arms[1].clutch = HOME + [0.0, 0.0, by], clutch
        return round(
            float((np.array(device.sample(now).place(1)) - teleoperator.estimator.sole(1))[2]), 9
        )

    # Closed from the beginning, then let go, taken hold of, and led.
    assert [moved(0.0, True), moved(0.05, True)] == [0.0, 0.0]
    assert [moved(0.05, False), moved(0.05, True)] == [0.0, 0.0]
    assert moved(0.08, True) == 0.03
    # Gone and back, closed as it was.
    arms[1].there = False
    assert moved(0.08, True) == 0.0
    arms[1].there = True
    assert [moved(0.08, True), moved(0.12, True)] == [0.0, 0.0]


@pytest.mark.parametrize("kind", ["list", "tuple", "float32", "int64", "strided"])
def test_arms_may_speak_in_lists_and_other_numbers(get_robot, kind):
    def given(*place):
        if kind == "strided":
            return np.array([place, place]).T[:, 0]
        named = {"list": list, "tuple": tuple}.get(kind)
        return named(place) if named else np.array(place).astype(kind)

    arms = Arm(clutch=np.bool_(False)), Arm(clutch=0)
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation="velocity")
    device = HapticFeet(HapticDriver(*arms), teleoperator)
    for arm in arms:
        arm.place = given(1.0, 0.0, 0.0)
    device.sample(0.0)
    arms[1].clutch = 1
    before = np.array(device.sample(0.005).place(1))
    arms[1].place = given(1.0, 0.0, 0.25) if kind != "int64" else given(1, 0, 0)
    risen = np.array(device.sample(0.01).place(1)) - before
    np.testing.assert_allclose(risen, [0.0, 0.0, 0.0 if kind == "int64" else 0.25], atol=1e-12)
    place, clutch = device.driver.readings[1]
    assert place.dtype == np.float64
    assert clutch is True
    assert device.driver.errors == (None, None)


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ((np.zeros(2), True), "Expected `array` of length 3, got 2"),
        ((np.zeros((3, 1)), True), "Expected `float`, got `array`"),
        (("up!", True), "Expected `array | null`, got `str`"),
        ((HOME, None), "Expected `bool | int`, got `null`"),
        ((HOME, "closed"), "Expected `bool | int`, got `str`"),
        (HOME, "Expected `array` of length 2, got 3"),
        (1, "Expected `array`, got `int`"),
    ],
)
def test_what_is_no_reading_is_said_by_the_device(get_robot, answer, words, side):
    arms = Arm(clutch=False), Arm(clutch=False)
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation="velocity")
    device = teleoperator.device = HapticFeet(HapticDriver(*arms), teleoperator)
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
def test_an_arm_that_is_gone_lets_go_of_its_own_foot_alone(get_robot, gone):
    arms = Arm(clutch=False), Arm(clutch=False)
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation="velocity")
    device = HapticFeet(HapticDriver(*arms), teleoperator)
    device.sample(0.0)
    for arm in arms:
        arm.clutch = True
    device.sample(0.005)

    def heights(time, by):
        for arm in arms:
            arm.place = HOME + [0.0, 0.0, by]
        sample = device.sample(time)
        places = zip(map(sample.place, (0, 1)), teleoperator.estimator.anchors, strict=True)
        return [round(float(place[2] - anchor[2]), 9) for place, anchor in places]

    assert heights(0.01, 0.05) == [0.05, 0.05]
    arms[gone].there = False
    # The other one is led on, without being let go in between.
    assert heights(0.015, 0.08) == ([0.0, 0.08] if gone == 0 else [0.08, 0.0])
    arms[1 - gone].there = False
    assert device.sample(0.02) is None


@pytest.mark.parametrize("to", [0.0, 1.7e9])
def test_arms_go_on_where_the_robots_clock_jumps_to(get_robot, to):
    arms = Arm(), Arm()
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation="velocity")
    device = HapticFeet(HapticDriver(*arms), teleoperator)
    for tick in range(20):
        device.sample(3.0 + 0.005 * tick)
    before = len(arms[0].forces)
    for tick in range(20):
        device.sample(to + 0.005 * tick)
    assert len(arms[0].forces) - before == pytest.approx(96, abs=1)
