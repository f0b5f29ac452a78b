"""What cannot be walked, and numbers that cannot be."""

import time as clock
from dataclasses import FrozenInstanceError, asdict, replace
from unittest.mock import Mock

import numpy as np
import pinocchio as pin
import pytest
from legs import measured_leg
from msgspec import structs
from odd import odd
from standing import footing
from unchecked import run_unchecked
from walker import hands, up_and_down

from poise.apps.teleoperation import (
    VELOCITY_TELEOP_PLANT,
    plant_from_json,
    run_teleop,
    terrain_blocks,
)
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, RobotError, UnknownNameError
from poise.locomotion import (
    BodyCommand,
    DeviceStatus,
    OperatorSample,
    ScriptedDevice,
    StepTeleoperator,
    TeleopParameters,
    TrackedPose,
    WayPoint,
)
from poise.locomotion._pendulum import ComShifter
from poise.locomotion._stepping._sample import FieldError, checked_sample
from poise.locomotion._stepping._stance._parameters import biped_of
from poise.locomotion._stepping._velocity_tasks import velocity_numbers
from poise.robots import Sole, standing_posture
from poise.sim import PlantConfig


def test_a_robot_without_feet_is_refused(get_robot):
    with pytest.raises(ConfigurationError, match="arm6.*cannot walk on two feet"):
        StepTeleoperator(get_robot("arm6"), actuation="velocity")


def test_legs_of_five_joints_are_refused(get_robot):
    robot = get_robot("biped20")
    role = robot.roles["left_sole"]
    # A sole on the ankle: five joints above it.
    model = robot.model.copy()
    frame = model.frames[model.getFrameId(role.name)]
    frame.parentJoint = model.parents[frame.parentJoint]
    with pytest.raises(ConfigurationError, match="left_sole has too few joints"):
        StepTeleoperator(replace(robot, model=model), actuation="velocity")


def test_the_lift_radius_fits_a_sole_that_is_hardly_there(get_robot):
    robot = get_robot("biped20")
    small = {n: Sole(name=n, length=0.2, width=0.05) for n in robot.soles}
    biped = biped_of(replace(robot, soles=small), robot.q_home)
    assert velocity_numbers(biped).r_lift <= 0.025


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_gains_that_break_38_are_refused(get_robot, share):
    robot = get_robot("biped20")
    square = StepTeleoperator(robot, actuation="velocity").driver.omega ** 2
    parameters = TeleopParameters(kp=share * square)
    with pytest.raises(ConfigurationError, match=r"k_p.*omega\^2"):
        StepTeleoperator(robot, parameters=parameters, actuation="velocity")
    assert StepTeleoperator(
        robot, parameters=TeleopParameters(kp=1.01 * square), actuation="velocity"
    )


@pytest.mark.parametrize(
    "bad",
    [{"dt": 0.0}, {"step_max": np.nan}, {"lower_height": 0.03}, {"kp": np.inf}],
)
@pytest.mark.filterwarnings("ignore")
def test_numbers_that_cannot_be_are_refused(bad):
    with pytest.raises(ConfigurationError):
        TeleopParameters(**bad)


@pytest.mark.parametrize(
    ("name", "replacement"),
    [
        ("w_S2", "the velocity level has the paper's number"),
        ("touch_speed", "it follows from the robot's CoM height and soles"),
        ("land_load", "it is the same for every robot"),
        ("servo_stiffness", "servo_gains of the StepTeleoperator"),
    ],
)
def test_a_parameter_that_was_removed_is_refused_with_what_is_there_now(name, replacement):
    with pytest.raises(ConfigurationError, match=f"removed; got '{name}'; wanted .*{replacement}"):
        TeleopParameters(**{name: 1.0})
    with pytest.raises(ConfigurationError, match=f"removed; got '{name}'"):
        replace(TeleopParameters(), **{name: 1.0})


def test_feet_too_close_are_refused(get_robot):
    robot = get_robot("biped20")
    model = robot.model.copy()
    left, right = (model.frames[model.getFrameId(name)] for name in robot.soles)
    left.parentJoint, left.placement = right.parentJoint, right.placement
    together = replace(robot, model=model)
    with pytest.raises(ConfigurationError, match="too close"):
        biped_of(together, together.q_home)


def test_a_plant_that_has_another_tick_is_refused(get_robot):
    robot, device = get_robot("biped20"), ScriptedDevice([], np.zeros(3), np.zeros(3))
    with pytest.raises(UnknownNameError, match="'position'; choices: velocity, torque"):
        StepTeleoperator(robot, actuation="position")
    with pytest.raises(ConfigurationError, match="different control periods"):
        run_teleop(robot, device, PlantConfig(), duration=1.0)
    with pytest.raises(ConfigurationError, match="different control periods"):
        run_teleop(robot, device, replace(VELOCITY_TELEOP_PLANT, control_dt=0.01), duration=1.0)


REFUSED = """
import json, sys
import numpy as np
from poise.apps.teleoperation import run_teleop
from poise.errors import ConfigurationError
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
        "parameters=False": "parameters of the teleoperation is of the wrong kind; got False",
        "q_start=[0.0, 1.0]": "no configuration of biped20: q is an array of shape (2,)",
        "q_start='home'": "the start is no configuration of biped20; got 'home'; wanted one like",
        "q_start=0.0 * robot.q_home": "the start is no configuration of biped20: the base quat",
        "q_start=np.nan * robot.q_home": "the start is no configuration of biped20: in q, entry 0",
        "seed=-1": "seed of the run is no whole number; got -1; wanted 0, 1, 2",
        "seed=0.5": "seed of the run is no whole number; got 0.5",
        "seed=True": "seed of the run is no whole number; got True",
        "device=None": "the device that walks the robot is of the wrong kind; got None",
        "device=lambda t: 3.0": "the device that walks the robot is of the wrong kind; got 3.0",
        "pushes=[(3, (1.0, 0.0, 0.0))]": "a push is of the wrong kind; got (3, (1.0, 0.0, 0.0))",
        "pushes=[3.0]": "a push is of the wrong kind; got 3.0; wanted tick, force [N], and",
        "pushes=3.0": "pushes of the run is of the wrong kind; got 3.0; wanted",
        "pushes=[(0.5, (1.0, 0.0, 0.0), 0.1)]": "the tick of a push is no whole number; got 0.5",
        "pushes=[(3, (1.0, 0.0), 0.1)]": "force",
        "pushes=[(3, (1.0, 0.0, 0.0), -0.1)]": "duration",
    }  # fmt: skip
    said = run_unchecked(REFUSED, *wrong)
    for options, message in wrong.items():
        assert said[options].startswith("ConfigurationError: "), said[options]
        assert message in said[options], (options, said[options])


def test_pushes_may_be_in_any_order(get_robot):
    early, late = (3, (20.0, 0.0, 0.0), 0.02), (40, (0.0, 20.0, 0.0), 0.02)
    ends = [
        run_teleop(
            get_robot("biped20"),
            lambda t: ScriptedDevice([], *t.estimator.anchors),
            duration=0.15,
            pushes=pushes,
        ).plant.data.qpos
        for pushes in ([early, late], [late, early])
    ]
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize("name", ["flat", "obstacle", "steps", "bumps"])
def test_terrain_is_for_bipeds(get_robot, name):
    with pytest.raises(ConfigurationError, match="'arm6' cannot walk on two feet"):
        terrain_blocks(name, get_robot("arm6"))


def test_a_run_with_a_driver_of_its_own_is_not_recorded(get_robot, tmp_path):
    with pytest.raises(ConfigurationError, match="recorded"):
        run_teleop(
            get_robot("biped20"),
            ScriptedDevice([], np.zeros(3), np.zeros(3)),
            VELOCITY_TELEOP_PLANT,
            duration=1.0,
            driver=ComShifter(0.765),
            recording=tmp_path / "x.mcap",
        )


def test_way_points_have_to_be_in_order_and_finite():
    zero = np.zeros(3)
    with pytest.raises(ConfigurationError, match="order of time"):
        ScriptedDevice([WayPoint(at=1.0, left=(0.0, 0.0, 0.0))] * 2, zero, zero)
    with pytest.raises(ConfigurationError, match=r"left\[1\] is out of range; got nan.*\[m\]"):
        WayPoint(at=1.0, left=(0.0, np.nan, 0.0))
    with pytest.raises(ConfigurationError, match="moves no device"):
        WayPoint(at=1.0)


def test_a_script_blends_from_rest_to_rest():
    device = ScriptedDevice(
        [WayPoint(at=1.0, left=(0.0, 0.0, 0.0)), WayPoint(at=2.0, left=(1.0, 0.0, 0.0))],
        np.ones(3),
        np.zeros(3),
    )
    x = np.array([device.sample(t).place(0)[0] for t in (0.0, 1.0, 1.001, 1.5, 1.999, 2.0, 9.0)])
    assert x[[0, 1, 3, 5, 6]] == pytest.approx([1.0, 1.0, 1.5, 2.0, 2.0])
    assert x[2] - 1.0 < 1e-7
    assert 2.0 - x[4] < 1e-7
    assert not any(device.sample(1.5).place(1))


def test_a_posture_out_of_reach_is_refused(get_robot):
    robot = get_robot("biped20")
    with pytest.raises(RobotError, match="do not get there"):
        standing_posture(robot, com_height=0.95)
    with pytest.raises(RobotError, match="no feet"):
        standing_posture(get_robot("arm6"))


def test_a_posture_stands_as_asked(get_robot):
    robot = get_robot("biped20")
    controller = StepTeleoperator(
        robot,
        q_start=standing_posture(robot, feet_apart=0.42, com_height=0.72),
        actuation="velocity",
    )
    left, right = controller.estimator.anchors
    com = controller.estimator.dynamics.com
    assert left - right == pytest.approx([0.0, 0.42, 0.0], abs=1e-8)
    assert com == pytest.approx([0.0, 0.0, 0.72], abs=1e-8)
    assert controller._numbers.r_lift == pytest.approx(0.12)


def test_a_plant_survives_json():
    import json

    from poise.sim import Block

    plant = replace(
        VELOCITY_TELEOP_PLANT.with_noise(),
        blocks=(Block(center=(0.1, 0.2), size=(0.1, 0.2, 0.3)),),
        link_errors=(PlantConfig.LinkError(link="torso_link", mass_scale=1.1),),
        payloads=(PlantConfig.Payload(frame="torso", mass=1.0),),
    )
    assert plant_from_json(json.loads(json.dumps(asdict(plant)))) == plant


def test_parameters_stay_as_they_were_checked():
    with pytest.raises(FrozenInstanceError):
        TeleopParameters().dt = 0.0


def test_what_holds_arrays_is_compared_as_the_thing_it_is(get_robot):
    """Not number by number, which would be no answer."""
    robot = get_robot("biped20")
    makes = (
        lambda: measured_leg(robot, next(iter(robot.soles))),
        lambda: biped_of(robot, robot.q_home),
        lambda: footing(robot),
    )
    for make in makes:
        one, other = make(), make()
        assert one == one
        assert one != other


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
    seen = []

    class Watched(Fails):
        def sample(self, time):
            status = teleoperator.status
            seen.append((teleoperator.device_error, status and status.device))
            return super().sample(time)

    def make(started):
        nonlocal teleoperator
        teleoperator = started
        return Watched(hands(*up_and_down())(started), what, 1.2, 3.2)

    teleoperator = None
    run = run_teleop(get_robot("biped20"), make, VELOCITY_TELEOP_PLANT, duration=3.4)
    assert not run.fell
    errors = [error for error, _ in seen if error is not None]
    assert len(errors) == pytest.approx(2.0 / teleoperator.parameters.dt, abs=2)
    assert teleoperator.device_error is None
    # The foot that was up went back to the ground by itself.
    assert DeviceStatus.LOST in {status for error, status in seen if error is not None}
    assert run.log.soles[round(3.15 / teleoperator.parameters.dt), 1, 2] < 0.01
    (said,) = (record for record in caplog.records if "the device failed" in record.message)
    assert said.exc_info[1] is errors[0]


def test_each_way_in_which_a_device_fails_is_said_once_until_reset(get_robot, caplog):
    teleoperator = StepTeleoperator(get_robot("biped20"))
    rest, device = teleoperator.resting_sample, Mock()
    teleoperator.device = device
    state = RobotState(teleoperator.robot.q_home, np.zeros(teleoperator.robot.nv))
    failures = [
        OSError("the cable is out"), ValueError("no number"), feet("up", (0.0, 0.0, 0.0)),
        feet((0.0, 0.0, 0.0), "up"), feet("down", "down"), odd(rest, velocity=0.0), rest,
    ]  # fmt: skip
    for _ in range(2):
        caplog.clear()
        for tick in range(4 * len(failures)):
            device.sample.side_effect = [failures[tick % len(failures)]]
            teleoperator.lead(teleoperator.estimator.update(state))
        assert [str(record.exc_info[1]) for record in caplog.records] == [
            "the cable is out",
            "no number",
            "position of left foot is 'up', not 3 numbers",
            "position of right foot is 'up', not 3 numbers",
            "velocity is 0.0, not 3 numbers",
        ]
        assert teleoperator.device_error is None
        teleoperator.reset()


def feet(left, right, left_rate=None, right_rate=None):
    """A sample of two foot devices at places of any kind."""
    return OperatorSample(
        0.0,
        (
            TrackedPose(left, velocity=left_rate),
            TrackedPose(right, velocity=right_rate),
        ),
    )


ORIGIN = (0.0, 0.0, 0.0)
WHOLE = feet(ORIGIN, ORIGIN)
HAND, HEAD = TrackedPose(ORIGIN, True), TrackedPose(None, True, (0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("time", None), ("time", "now"), ("time", np.zeros(2)), ("body", None),
        ("height", None), ("torso", (0.0, 0.0)), ("turns", ("a", "b")), ("velocity", None),
        ("velocity", (0.1, 0.0)), ("velocity", np.zeros(2)), ("hands", ()), ("hands", None),
        ("hands", (1.0, 2.0)), ("feet", ()), ("head", "ahead"), ("upright", None),
        ("upright", "yes"), ("rest", np.zeros(2)), ("head", odd(HEAD, clutch=np.zeros(2))),
        ("hands", (None, odd(HAND, clutch=0.5))), ("velocity", 0.0), ("velocity", np.array(0.1)),
        ("torso", np.zeros((3, 1))), ("torso", np.zeros(3, bool)), ("time", np.zeros(1)),
        ("height", "tall"), ("turns", None), ("feet", 0.0),
    ],
    ids=repr,
)  # fmt: skip
def test_a_sample_of_which_something_is_of_another_kind_is_none(field, value):
    of_body = hasattr(WHOLE.body, field)
    changed = {"body": odd(WHOLE.body, **{field: value})} if of_body else {field: value}
    with pytest.raises(FieldError, match=field.removesuffix("s")) as caught:
        checked_sample(odd(WHOLE, **changed))
    (named,) = caught.value.fields
    assert field.removesuffix("s") in named


@pytest.mark.parametrize("actuation", ["torque", "velocity"])
@pytest.mark.parametrize("number", [1e308, -1e308, np.inf, np.nan, 1e-308])
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
    state, dt = RobotState(teleoperator.robot.q_home, np.zeros(teleoperator.robot.nv)), 0.0
    controller, device = teleoperator.controller(), Mock()
    teleoperator.device = device
    for tick in range(4 * len(said)):
        dt = tick * teleoperator.dt
        changed = {name: wild[name] for name in said[tick % len(said)]}
        device.sample.return_value = structs.replace(rest, time=dt, **changed)
        known = teleoperator.estimator.update(replace(state, time=dt))
        teleoperator.lead(known)
        command = controller.step(known)
        given = command.torque if actuation == "torque" else command.velocity
        assert np.isfinite(given).all()
        assert teleoperator.device_error is None


@pytest.mark.parametrize("kind", [int, np.float32, np.int64, np.float64])
def test_every_number_of_a_sample_becomes_a_float(kind):
    """Pinocchio takes no float32, and a recording keeps no whole numbers."""
    one, numbers = kind(1), np.array((0, 1, 2), dtype=kind)
    body = odd(WHOLE.body, height=one, torso=tuple(numbers), turns=tuple(numbers[:2]))
    hand = odd(HAND, clutch=np.bool_(True))
    asked = odd(WHOLE, time=one, velocity=numbers, body=body, upright=1, hands=(hand, None))
    sample, fault = checked_sample(asked)
    assert fault is None
    assert (sample.time, sample.velocity) == (1.0, (0.0, 1.0, 2.0))
    assert sample.body == BodyCommand(1.0, (0.0, 1.0, 2.0), (0.0, 1.0))
    for number in (sample.time, *sample.velocity, *sample.body.numbers):
        assert type(number) is float
    assert sample.upright is True
    assert sample.hands[0].clutch is True


@pytest.mark.parametrize("kind", [np.float32, np.int64, np.float64])
def test_arrays_do_where_numbers_are_wanted(kind):
    def given(*values):
        return np.array(values if len(values) > 1 else values[0], dtype=kind)

    body = odd(WHOLE.body, height=given(1), torso=given(1, 2, 3), turns=[given(4), 5.0])
    asked = odd(WHOLE, time=given(6), body=body, velocity=given(7, 8, 9), rest=np.array(True))
    sample, fault = checked_sample(asked)
    assert fault is None
    assert sample.body == BodyCommand(1.0, (1.0, 2.0, 3.0), (4.0, 5.0))
    assert (sample.time, sample.velocity, sample.rest) == (6.0, (7.0, 8.0, 9.0), True)
    for value in (sample.time, *sample.velocity, *sample.body.numbers):
        assert type(value) is float


class Wordy:
    """Something that takes long to say what it is."""

    def __repr__(self):
        raise AssertionError("nobody has the time")


LONG = [[0.5] * 1000] * 1000


@pytest.mark.parametrize(
    "value",
    [
        LONG, tuple(LONG), LONG[:3], [LONG, LONG, LONG], {0: LONG}, "left" * 10**6, 10**5000,
        Wordy(), [Wordy()] * 3, np.zeros((1000, 1000)), np.array(["left" * 10**6]),
        np.array([LONG, None], dtype=object),
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_what_is_no_place_is_said_in_a_line_and_in_little_time(value):
    begin = clock.perf_counter()
    _, fault = checked_sample(feet(value, ORIGIN))
    for field in ("time", "velocity", "hands", "head", "body"):
        with pytest.raises((TypeError, OverflowError)) as caught:
            checked_sample(odd(WHOLE, **{field: value}))
        assert len(str(caught.value)) < 400
    assert clock.perf_counter() - begin < 0.05
    assert fault.fields == ("position of left foot",)
    assert len(str(fault)) < 400


def test_a_number_too_large_for_a_float_makes_a_device_silent_and_ends_no_loop(get_robot):
    teleoperator = StepTeleoperator(get_robot("biped20"))
    rest, device = teleoperator.resting_sample, Mock()
    teleoperator.device = device
    state = RobotState(teleoperator.robot.q_home, np.zeros(teleoperator.robot.nv))
    body = odd(BodyCommand(), height=10**400)
    for bad in ({"time": 10**400}, {"velocity": (10**400, 0, 0)}, {"body": body}):
        device.sample.return_value = odd(rest, **bad)
        teleoperator.lead(teleoperator.estimator.update(state))
        assert isinstance(teleoperator.device_error, FieldError)
        assert str(teleoperator.device_error).startswith(("time is", "velocity is", "height is"))


def test_a_walk_by_numbers_of_a_joystick_ends_no_loop(get_robot):
    teleoperator = StepTeleoperator(get_robot("biped20"))
    rest, device = teleoperator.resting_sample, Mock()
    teleoperator.device = device
    state = RobotState(teleoperator.robot.q_home, np.zeros(teleoperator.robot.nv))
    for tick in range(40):
        time = teleoperator.dt * tick
        velocity = np.array((0.3, 0.0, 0.1) if tick > 2 else (0.0, 0.0, 0.0), dtype=np.float32)
        device.sample.return_value = odd(rest, time=time, velocity=velocity)
        teleoperator.lead(teleoperator.estimator.update(replace(state, time=time)))
        assert teleoperator.device_error is None
    assert teleoperator.status.device is DeviceStatus.WALKING


def test_how_far_feet_are_apart_is_along_the_robot(get_robot):
    robot = get_robot("biped20")
    usual = StepTeleoperator(robot, actuation="torque")._numbers
    for yaw in (0.5, 1.5708, -2.5):
        turned = StepTeleoperator(robot, q_start=facing(robot, yaw), actuation="torque")
        assert turned.ahead == pytest.approx(yaw)
        assert turned._numbers.r_lift == pytest.approx(usual.r_lift)


def test_at_velocity_level_a_turned_start_is_refused(get_robot):
    robot = get_robot("biped20")
    with pytest.raises(
        ConfigurationError, match=r"starts turned; got '0.50 rad'; wanted feet along"
    ):
        StepTeleoperator(robot, q_start=facing(robot, 0.5), actuation="velocity")


def facing(robot, yaw):
    """Its home, turned about the vertical."""
    q = robot.q_home.copy()
    turn = pin.exp3(np.array([0.0, 0.0, yaw]))
    q[:3] = turn @ q[:3]
    q[3:7] = pin.Quaternion(turn @ pin.Quaternion(q[3:7]).matrix()).coeffs()
    return q


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"left": np.full(3, np.nan)}, ""),
        ({"left": np.zeros(2)}, "position of left foot is array([0., 0.]), not 3 numbers"),
        ({"left": np.zeros((3, 1))}, "position of left foot is array("),
        ({"right": "abc"}, "position of right foot is 'abc', not 3 numbers"),
        ({"right": ["0", "1", "2"]}, "position of right foot is ['0', '1', '2'], not 3 n"),
        ({"right": [0.0, [1.0], 2.0]}, "position of right foot is [0.0, [1.0], 2.0], not 3 n"),
        ({"left": np.zeros(3, complex)}, "position of left foot is array("),
        ({"left": np.zeros(3, bool)}, "position of left foot is array("),
        ({"rates": np.zeros(4)}, "velocity of right foot is array("),
        ({"hands": (odd(HAND, position=()), None)}, "position of left hand is (), not 3 numbers"),
        ({"hands": (None, odd(HAND, orientation=[1.0]))}, "orientation of right hand is [1.0], n"),
        ({"head": odd(HEAD, orientation=np.zeros(3))}, "orientation of head is array("),
        ({"left": 1.0, "right": 2.0}, "position of left foot is 1.0, not 3 numbers; position of"),
    ],
    ids=str,
)
def test_what_is_no_place_is_ignored_and_said_and_the_rest_counts(changed, fault):
    places = [changed.get(name, ORIGIN) for name in ("left", "right")]
    others = {name: changed[name] for name in ("hands", "head") if name in changed}
    given = structs.replace(feet(*places, right_rate=changed.get("rates")), **others)
    sample, said = checked_sample(given)
    assert str(said).startswith(fault) if fault else said is None
    for foot, name in enumerate(("left", "right")):
        expected = np.full(3, np.nan if name in changed else 0.0)
        np.testing.assert_array_equal(sample.place(foot), expected)
    assert sample.feet[0].velocity is None
    if "rates" in changed:
        np.testing.assert_array_equal(sample.feet[1].velocity, np.full(3, np.nan))
    if "head" in changed:
        np.testing.assert_array_equal(sample.head.orientation, np.full(4, np.nan))
    if "hands" in changed:
        left, right = sample.hands
        bad = left.position if right is None else right.orientation
        assert np.isnan(bad).all()


@pytest.mark.parametrize("kind", [list, tuple, np.float32, np.int64, np.float64])
def test_places_are_taken_as_any_numbers(kind):
    """Those of a headset are of float32, those of a message are lists."""

    def given(*numbers):
        return kind(numbers) if kind in (list, tuple) else np.array(numbers, dtype=kind)

    hand = odd(
        HAND, position=given(0, 1, 2), orientation=given(0, 1, 2, 3), velocity=given(4, 5, 6)
    )
    asked = structs.replace(
        feet(given(1, 2, 3), given(4, 5, 6), given(7, 8, 9)),
        hands=(None, hand),
        head=odd(HEAD, orientation=given(0, 0, 0, 1)),
    )
    sample, fault = checked_sample(asked)
    assert fault is None
    assert [sample.place(foot) for foot in (0, 1)] == [(1, 2, 3), (4, 5, 6)]
    assert [part.velocity for part in sample.feet] == [(7, 8, 9), None]
    assert sample.hands[0] is None
    np.testing.assert_array_equal(sample.hands[1].position, [0, 1, 2])
    np.testing.assert_array_equal(sample.hands[1].orientation, [0, 1, 2, 3])
    np.testing.assert_array_equal(sample.hands[1].velocity, [4, 5, 6])
    np.testing.assert_array_equal(sample.head.orientation, [0, 0, 0, 1])
    vectors = (sample.place(0), sample.place(1), sample.feet[0].velocity, *sample.hands[1:])
    for number in (*vectors[0], *vectors[1], *vectors[2], *vectors[3].position):
        assert type(number) is float


def test_a_place_of_another_size_ends_no_record(get_robot):
    def make(teleoperator):
        rest = teleoperator.resting_sample

        class Odd:
            def sample(self, time):
                left, right = rest.feet
                left = odd(left, position=np.zeros(2)) if time > 0.05 else left
                return structs.replace(rest, time=time, feet=(left, right))

        return Odd()

    run = run_teleop(get_robot("biped20"), make, VELOCITY_TELEOP_PLANT, duration=0.2)
    assert run.plant.time == pytest.approx(0.2)
    assert (
        str(run.teleoperator.device_error)
        == "position of left foot is array([0., 0.]), not 3 numbers"
    )
    places = run.record["target/left device"]
    assert np.isfinite(places[5]).all()
    assert np.isnan(places[-1]).all()
    # The other device goes on.
    assert np.isfinite(run.record["target/right device"][-1]).all()
    assert run.teleoperator.status.device is DeviceStatus.REFUSED
