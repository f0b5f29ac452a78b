"""What cannot be walked, and numbers that cannot be."""

import time as clock
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from msgspec import structs
from odd import odd
from unchecked import run_unchecked
from walker import Says, facing, feet, hands, up_and_down

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, run_teleop, terrain_blocks
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.locomotion import (
    BodyCommand,
    ComShifter,
    DeviceStatus,
    FieldError,
    ScriptedDevice,
    StepTeleoperator,
    TeleopParameters,
    TrackedPose,
    WayPoint,
)
from poise.sim import PlantConfig

STILL = ScriptedDevice([], np.zeros(3), np.zeros(3))


def with_sole(robot, name, parent, placement=None):
    """The same robot, one of its soles on another joint."""
    model = robot.model.copy()
    frame = model.frames[model.getFrameId(name)]
    frame.parentJoint = parent
    frame.placement = frame.placement if placement is None else placement
    return replace(robot, model=model)


def test_robots_that_cannot_be_walked_are_refused(get_robot):
    robot, arm = get_robot("biped20"), get_robot("arm6")
    for make in (StepTeleoperator, lambda robot: terrain_blocks("steps", robot)):
        with pytest.raises(ConfigurationError, match="arm6.*cannot walk on two feet"):
            make(arm)
    left, right = (robot.model.frames[robot.frame_id(name)] for name in robot.soles)
    # A sole on the ankle: five joints above it.
    above = robot.model.parents[left.parentJoint]
    with pytest.raises(ConfigurationError, match="left_sole has too few joints"):
        StepTeleoperator(with_sole(robot, left.name, above))
    together = with_sole(robot, left.name, right.parentJoint, right.placement)
    with pytest.raises(ConfigurationError, match="too close"):
        StepTeleoperator(together)
    with pytest.raises(ConfigurationError, match=r"starts turned; got '0.50 rad'; wanted feet al"):
        StepTeleoperator(robot, q_start=facing(robot, 0.5), actuation="velocity")


def test_gains_that_break_38_are_refused(get_robot):
    robot = get_robot("biped20")
    square = StepTeleoperator(robot, actuation="velocity").driver.omega ** 2
    parameters = TeleopParameters(kp=square)
    with pytest.raises(ConfigurationError, match=r"k_p.*omega\^2"):
        StepTeleoperator(robot, parameters=parameters, actuation="velocity")
    parameters = TeleopParameters(kp=1.01 * square)
    assert StepTeleoperator(robot, parameters=parameters, actuation="velocity")


@pytest.mark.parametrize(
    "bad",
    [{"dt": 0.0}, {"step_max": np.nan}, {"lower_height": 0.03}, {"kp": np.inf}, {"w_S2": 1.0}],
)
@pytest.mark.filterwarnings("ignore")
def test_numbers_that_cannot_be_are_refused(bad):
    with pytest.raises((ConfigurationError, TypeError)):
        TeleopParameters(**bad)


REFUSED = """
import json, sys
import numpy as np
from poise.apps.teleoperation import run_teleop
from poise.locomotion import ScriptedDevice
from poise.robots import load_robot
robot, said = load_robot("biped20"), {}
for options in sys.argv[1:]:
    given = dict(device=ScriptedDevice([], np.zeros(3), np.zeros(3)), duration=1.0)
    try:
        run_teleop(robot, **given | eval(f"dict({options})"))
        said[options] = "accepted"
    except Exception as error:
        said[options] = f"{type(error).__name__}: {error}"
print(json.dumps(said))
"""


def test_what_a_run_cannot_be_made_of_is_said_before_it_begins():
    """Unchecked: the shape checks of the tests would answer first."""
    wrong = {
        "duration='2'": "duration of the run [s] is not a number; got '2'",
        "plant='torque'": "plant of the run is of the wrong kind; got 'torque'; wanted PlantC",
        "parameters={}": "parameters of the teleoperation is of the wrong kind; got {}",
        "q_start=[0.0, 1.0]": "no configuration of biped20: q is an array of shape (2,)",
        "q_start='home'": "the start is no configuration of biped20; got 'home'; wanted one like",
        "q_start=0.0 * robot.q_home": "the start is no configuration of biped20: the base quat",
        "seed=-1": "seed of the run is no whole number; got -1; wanted 0, 1, 2",
        "device=lambda t: 3.0": "the device that walks the robot is of the wrong kind; got 3.0",
        "pushes=[3.0]": "a push is of the wrong kind; got 3.0; wanted tick, force [N], and",
        "pushes=[(0.5, (1.0, 0.0, 0.0), 0.1)]": "the tick of a push is no whole number; got 0.5",
        "pushes=[(3, (1.0, 0.0), 0.1)]": "force",
        "pushes=[(3, (1.0, 0.0, 0.0), -0.1)]": "duration",
    }
    said = run_unchecked(REFUSED, *wrong)
    for options, message in wrong.items():
        assert said[options].startswith("ConfigurationError: "), said[options]
        assert message in said[options], (options, said[options])


def test_a_plant_of_another_tick_and_a_recording_with_a_driver_are_refused(get_robot, tmp_path):
    robot, plant = get_robot("biped20"), replace(VELOCITY_TELEOP_PLANT, control_dt=0.01)
    for other in (PlantConfig(), plant):
        with pytest.raises(ConfigurationError, match="different control periods"):
            run_teleop(robot, STILL, other, duration=1.0)
    changes = {"driver": ComShifter(0.765), "recording": tmp_path / "x.mcap"}
    with pytest.raises(ConfigurationError, match="recorded"):
        run_teleop(robot, STILL, VELOCITY_TELEOP_PLANT, duration=1.0, **changes)


def test_way_points_have_to_be_in_order_and_finite():
    zero = np.zeros(3)
    with pytest.raises(ConfigurationError, match="order of time"):
        ScriptedDevice([WayPoint(at=1.0, left=(0.0, 0.0, 0.0))] * 2, zero, zero)
    with pytest.raises(ConfigurationError, match=r"left\[1\] is out of range; got nan.*\[m\]"):
        WayPoint(at=1.0, left=(0.0, np.nan, 0.0))
    with pytest.raises(ConfigurationError, match="moves no device"):
        WayPoint(at=1.0)


def test_a_script_blends_from_rest_to_rest():
    points = [WayPoint(at=1.0, left=(0.0, 0.0, 0.0)), WayPoint(at=2.0, left=(1.0, 0.0, 0.0))]
    device = ScriptedDevice(points, np.ones(3), np.zeros(3))
    x = np.array([device.sample(t).place(0)[0] for t in (0.0, 1.0, 1.001, 1.5, 1.999, 2.0, 9.0)])
    assert x[[0, 1, 3, 5, 6]] == pytest.approx([1.0, 1.0, 1.5, 2.0, 2.0])
    assert x[2] - 1.0 < 1e-7
    assert 2.0 - x[4] < 1e-7
    assert not any(device.sample(1.5).place(1))


class Fails:
    """A device whose driver fails in the middle of a step, and answers again later."""

    def __init__(self, inner, what, begin, end):
        self._inner, self._what, self._begin, self._end = inner, what, begin, end

    def sample(self, time):
        if not self._begin <= time < self._end:
            return self._inner.sample(time)
        if isinstance(self._what, Exception):
            raise self._what
        return self._what


@pytest.mark.parametrize(
    "what", [OSError("the cable is out"), "left foot up"], ids=["raise", "str"]
)
def test_a_device_that_fails_counts_as_silent_and_is_said_once(get_robot, what, caplog):
    seen, made = [], []

    class Watched(Fails):
        def sample(self, time):
            status = made[0].status
            seen.append((made[0].device_error, status and status.device))
            return super().sample(time)

    def make(started):
        made.append(started)
        return Watched(hands(*up_and_down())(started), what, 1.2, 3.2)

    run = run_teleop(get_robot("biped20"), make, VELOCITY_TELEOP_PLANT, duration=3.4)
    assert not run.fell
    errors = [error for error, _ in seen if error is not None]
    assert len(errors) == pytest.approx(2.0 / made[0].dt, abs=2)
    assert made[0].device_error is None
    # The foot that was up went back to the ground by itself.
    assert DeviceStatus.LOST in {status for error, status in seen if error is not None}
    assert run.log.soles[round(3.15 / made[0].dt), 1, 2] < 0.01
    (said,) = (record for record in caplog.records if "the device failed" in record.message)
    assert said.exc_info[1] is errors[0]


ORIGIN = (0.0, 0.0, 0.0)
WHOLE = feet(ORIGIN, ORIGIN)
HAND, HEAD = TrackedPose(ORIGIN, True), TrackedPose(None, True, (0.0, 0.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def read(get_robot):
    """Has a teleoperator read a sample; returns what it took, and its error."""
    teleoperator = StepTeleoperator(get_robot("biped20"))
    state = RobotState(teleoperator.robot.q_home, np.zeros(teleoperator.robot.nv))

    def take(sample):
        teleoperator.device = Says(sample)
        teleoperator.lead(teleoperator.estimator.update(state))
        return teleoperator.status.sample, teleoperator.device_error

    return take


def test_each_way_in_which_a_device_fails_is_said_once_until_reset(get_robot, caplog):
    teleoperator = StepTeleoperator(get_robot("biped20"))
    rest, device = teleoperator.resting_sample, Mock()
    teleoperator.device = device
    state = RobotState(teleoperator.robot.q_home, np.zeros(teleoperator.robot.nv))
    failures = [
        OSError("the cable is out"), ValueError("no number"), feet("up", ORIGIN),
        feet(ORIGIN, "up"), feet("down", "down"), odd(rest, velocity=0.0), rest,
    ]  # fmt: skip
    for _ in range(2):
        caplog.clear()
        for tick in range(4 * len(failures)):
            device.sample.side_effect = [failures[tick % len(failures)]]
            teleoperator.lead(teleoperator.estimator.update(state))
        starts = (
            "the cable", "no number", "position of left", "position of right", "velocity: Expected"
        )  # fmt: skip
        for record, start in zip(caplog.records, starts, strict=True):
            assert str(record.exc_info[1]).startswith(start)
        assert teleoperator.device_error is None
        teleoperator.reset()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("time", None), ("time", np.zeros(2)), ("time", 10**400), ("body", None),
        ("height", "tall"), ("torso", (0.0, 0.0)), ("torso", np.zeros(3, bool)),
        ("turns", ("a", "b")), ("velocity", 0.0), ("velocity", (10**400, 0, 0)), ("hands", ()),
        ("feet", 0.0), ("head", "ahead"), ("upright", "yes"), ("rest", np.zeros(2)),
        ("head", odd(HEAD, clutch=np.zeros(2))), ("hands", (None, odd(HAND, clutch=0.5))),
    ],
    ids=lambda value: str(value)[:40],
)  # fmt: skip
def test_a_sample_of_which_something_is_of_another_kind_is_none(read, field, value):
    of_body = hasattr(WHOLE.body, field)
    changed = {"body": odd(WHOLE.body, **{field: value})} if of_body else {field: value}
    sample, error = read(odd(WHOLE, **changed))
    assert sample is None
    assert isinstance(error, FieldError)
    assert field.removesuffix("s") in str(error)


@pytest.mark.parametrize("actuation", ["torque", "velocity"])
@pytest.mark.parametrize("number", [1e308, -np.inf, np.nan, 1e-308])
def test_no_number_of_a_sample_ends_the_loop(get_robot, actuation, number):
    teleoperator = StepTeleoperator(get_robot("biped20"), actuation=actuation)
    rest = teleoperator.resting_sample
    point = np.full(3, number)
    hand = TrackedPose(point, True, np.full(4, number), point)
    wild = {
        "feet": (TrackedPose(point, velocity=point), rest.feet[1]), "hands": (hand, hand),
        "head": TrackedPose(None, True, np.full(4, number)), "velocity": (number, number, number),
        "body": BodyCommand(number, (number, number, number), (number, number)),
    }  # fmt: skip
    said = [(), *[(name,) for name in wild], tuple(wild)]
    state = RobotState(teleoperator.robot.q_home, np.zeros(teleoperator.robot.nv))
    controller = teleoperator.controller()
    for tick in range(4 * len(said)):
        time = tick * teleoperator.dt
        changed = {name: wild[name] for name in said[tick % len(said)]}
        teleoperator.device = Says(structs.replace(rest, time=time, **changed))
        known = teleoperator.estimator.update(replace(state, time=time))
        teleoperator.lead(known)
        command = controller.step(known)
        given = command.torque if actuation == "torque" else command.velocity
        assert np.isfinite(given).all()
        assert teleoperator.device_error is None


@pytest.mark.parametrize("kind", [list, np.float32, np.int64])
def test_every_number_of_a_sample_becomes_a_float(read, kind):
    """Those of a headset are of float32; Pinocchio takes none, and records keep no whole ones."""

    def given(*numbers):
        numbers = numbers if len(numbers) > 1 else numbers[0]
        return numbers if kind is list else np.array(numbers, dtype=kind)

    body = odd(WHOLE.body, height=given(1), torso=given(1, 2, 3), turns=[given(4), 5.0])
    hand = odd(HAND, position=given(0, 1, 2), orientation=given(0, 1, 2, 3), clutch=np.bool_(True))
    asked = odd(feet(given(1, 2, 3), given(4, 5, 6), given(7, 8, 9)), time=given(6), body=body)
    asked = odd(asked, velocity=given(7, 8, 9), upright=1, hands=(hand, None))
    sample, error = read(asked)
    assert error is None
    assert (sample.time, sample.velocity) == (6.0, (7.0, 8.0, 9.0))
    assert sample.body == BodyCommand(1.0, (1.0, 2.0, 3.0), (4.0, 5.0))
    assert [sample.place(foot) for foot in (0, 1)] == [(1, 2, 3), (4, 5, 6)]
    assert sample.feet[0].velocity == (7, 8, 9)
    assert sample.hands[0] == TrackedPose((0.0, 1.0, 2.0), True, (0.0, 1.0, 2.0, 3.0))
    numbers = (sample.time, *sample.velocity, *sample.body.numbers, *sample.place(0))
    assert {type(number) for number in (*numbers, *sample.hands[0].position)} == {float}
    assert sample.upright is True


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"left": np.full(3, np.nan)}, ""),
        ({"left": np.zeros(2)}, "position of left foot: Expected `array` of length 3, got 2"),
        ({"right": ["0", "1", "2"]}, "position of right foot: Expected `float`, got `str`"),
        ({"left": np.zeros(3, complex)}, "position of left foot: "),
        ({"left": np.zeros(3, bool)}, "position of left foot: Expected `float`, got `bool`"),
        ({"rates": np.zeros(4)}, "velocity of right foot: Expected `array` of length 3, got 4"),
        ({"hands": (odd(HAND, position=()), None)}, "position of left hand: "),
        ({"hands": (None, odd(HAND, orientation=[1.0]))}, "orientation of right hand: "),
        ({"head": odd(HEAD, orientation=np.zeros(3))}, "orientation of head: "),
        ({"left": 1.0, "right": [[0.5] * 1000] * 1000}, "position of left foot: "),
    ],
)
def test_what_is_no_place_is_ignored_and_said_and_the_rest_counts(read, changed, fault):
    places = [changed.get(name, ORIGIN) for name in ("left", "right")]
    others = {name: changed[name] for name in ("hands", "head") if name in changed}
    given = structs.replace(feet(*places, right_rate=changed.get("rates")), **others)
    begin = clock.perf_counter()
    sample, said = read(given)
    assert clock.perf_counter() - begin < 0.5
    assert str(said).startswith(fault) if fault else said is None
    for foot, name in enumerate(("left", "right")):
        expected = np.full(3, np.nan if name in changed else 0.0)
        np.testing.assert_array_equal(sample.place(foot), expected)
    assert sample.feet[0].velocity is None
    parts = (sample.feet[1].velocity, sample.head, *sample.hands)
    wrong = {"rates": parts[0], "head": parts[1] and parts[1].orientation}
    wrong["hands"] = parts[2].position if parts[2] else parts[3] and parts[3].orientation
    for name, vector in wrong.items():
        assert name not in changed or np.isnan(vector).all()
