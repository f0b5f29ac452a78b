"""`run_teleop`: a device walks a simulated robot. `replay_teleop`: its recording, again."""

import time as clock
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64, Int8

from poise._checks import checked_count, checked_kind, checked_number
from poise.apps.teleoperation._recording import (
    RecordedDevice,
    RecordedPush,
    Recording,
    RecordingError,
    TeleopRecorder,
    TeleopSetup,
    read_recording,
    recorded_robot,
    recording_of,
)
from poise.errors import ConfigurationError
from poise.locomotion import (
    ComDriver,
    ComShifter,
    Device,
    DeviceStatus,
    Mode,
    StepTeleoperator,
    TeleopParameters,
)
from poise.robots import Robot
from poise.sim import Plant, PlantConfig, RunRecord, check_period, rollout

MODES = tuple(Mode)  # The number of a mode in a log is its place here

VELOCITY_TELEOP_PLANT = PlantConfig(
    actuation="velocity",
    control_dt=5e-3,
    physics_dt=1e-3,
    servo=PlantConfig.Servo(stiffness=70.0, damping=2.5),
)
"""Velocity servos with position feedback, physics 1 ms, control 5 ms, by Zhang and Kikuuwe.

Stiffer than a plant's own, with which the ZMP lags by what the joints sag."""

TORQUE_TELEOP_PLANT = PlantConfig(actuation="torque", control_dt=2e-3, physics_dt=1e-3)
"""Torques, and the tick of the step teleoperator that commands them."""

# Tick, force [N] and duration [s] of a push
Push = RecordedPush | tuple[int, tuple[float, float, float], float]

# Makes a device for a teleoperator that has not begun: it has the poses of the feet
MakeDevice = Callable[[StepTeleoperator], Device]


@dataclass(frozen=True, kw_only=True, eq=False)
class TeleopLog:
    """Commands, feedback and motion of a teleoperated run: columns of its record, T ticks.

    Positions are in the world as the teleoperator estimates it; sides are left and right.
    """

    time: Float64[np.ndarray, " T"]  # before the tick [s]
    mode: Int8[np.ndarray, " T"]  # place in `tuple(Mode)`
    device: Int8[np.ndarray, " T"]  # place in `tuple(DeviceStatus)`
    devices: Float64[np.ndarray, "T 2 3"]  # sides, NaN where no sample came [m]
    zmp: Float64[np.ndarray, "T 2"]  # measured, smoothed [m]
    zmp_reference: Float64[np.ndarray, "T 2"]  # [m]
    cart_table_zmp: Float64[np.ndarray, "T 2"]  # CT-ZMP [m]
    com: Float64[np.ndarray, "T 3"]  # [m]
    soles: Float64[np.ndarray, "T 2 3"]  # sides [m]
    target: Float64[np.ndarray, "T 3"]  # of the swing foot, NaN with both on the ground [m]
    loads: Float64[np.ndarray, "T 2"]  # sides [N]
    tilt: Float64[np.ndarray, " T"]  # of the torso [rad]
    command: Float64[np.ndarray, "T nj"]  # velocity [rad/s] or torque [N m] of each joint
    q: Float64[np.ndarray, "T nq"]  # true configuration after the tick [m, rad]
    touched: Bool[np.ndarray, " T"]  # a solid part of the robot touched a block after the tick

    @classmethod
    def of(cls, record: RunRecord, dt: float) -> "TeleopLog":
        """Make the log of the record of a rollout with ticks of `dt` [s]."""
        # A state that the teleoperator cannot use before it began leaves no status: no row.
        end = record.times("zmp_reference")
        rows = np.isin(record.times("q"), end)
        touched = record["touched"][rows] if "touched" in record else np.zeros(len(end), np.bool_)
        command = record["command_torque" if "command_torque" in record else "command_velocity"]
        devices = [record[f"target/{side} device"][rows] for side in ("left", "right")]
        known = ("zmp", "cart_table_zmp", "com", "soles", "loads", "tilt")
        return cls(
            time=dt * (np.round(end / dt) - 1.0),
            mode=_places(record.notes("mode"), [mode.name for mode in MODES], end),
            device=_places(record.notes("device"), [status.name for status in DeviceStatus], end),
            devices=np.stack(devices, axis=1),
            zmp_reference=record["zmp_reference"],
            target=record["foot_target"],
            command=command[rows],
            q=record["q"][rows],
            touched=touched,
            **{name: record[f"estimate/{name}"] for name in known},
        )

    def __len__(self) -> int:
        return len(self.time)

    def when(self, mode: Mode) -> Bool[np.ndarray, " T"]:
        """Ticks in a mode."""
        return self.mode == MODES.index(mode)

    def entries(self, mode: Mode) -> Float64[np.ndarray, " n"]:
        """Times at which a mode was entered [s]."""
        now = self.when(mode)
        return self.time[now & ~np.concatenate(([False], now[:-1]))]


def _places(
    notes: Sequence[tuple[float, str]], names: Sequence[str], times: Float64[np.ndarray, " T"]
) -> Int8[np.ndarray, " T"]:
    """The place of the note that holds at each time."""
    starts = np.array([time for time, _ in notes])
    places = np.array([names.index(text) for _, text in notes], dtype=np.int8)
    return places[np.searchsorted(starts, times, side="right") - 1]


@dataclass(frozen=True, kw_only=True, eq=False)
class TeleopRun:
    """A finished run; plant and teleoperator are as they were at its end."""

    record: RunRecord = field(repr=False)
    log: TeleopLog  # columns of the operator's side, a row a tick
    plant: Plant = field(repr=False)
    teleoperator: StepTeleoperator = field(repr=False)
    fell: bool  # the robot fell, which ends a run
    # Least distance of any solid part of the robot from a block, up to 0.2 m; None without blocks
    clearance: float | None
    tick_us: float  # median time of one control step [us]
    real_time_factor: float  # simulated over elapsed time


def run_teleop(
    robot: Robot,
    device: Device | MakeDevice,
    plant: PlantConfig = TORQUE_TELEOP_PLANT,
    *,
    duration: float,
    seed: int = 0,
    parameters: TeleopParameters | None = None,
    rotator: bool = True,
    driver: ComDriver | ComShifter | None = None,
    q_start: Float64[np.ndarray, " nq"] | None = None,
    recording: str | Path | None = None,
    leader: Callable[..., StepTeleoperator] = StepTeleoperator,
    pushes: Sequence[Push] = (),
    solved_by: str | None = None,
) -> TeleopRun:
    """Walk a simulated robot by a device.

    Args:
        robot: a biped.
        device: gives samples, or makes a device for the teleoperator.
        plant: takes torques, or velocities, at the teleoperator's tick.
        duration: [s]; a fall ends the run earlier.
        seed: of the sensor noise.
        parameters: scaled to the robot when None.
        rotator: use the body rotator.
        driver: moves the CoM; the CoM shifter when None.
        q_start: configuration at the start; the robot's home when None.
        recording: log to write for `replay_teleop`, which takes the run's record, too.
        leader: leads by rules of its own, for studies.
        pushes: on the torso: tick, force in the world [N], duration [s]. Those of a recording come
            by themselves.
        solved_by: name of the controller that solves the stack, see `StepTeleoperator`.

    Raises:
        ConfigurationError: the plant has another tick; the robot cannot be walked, see
            `StepTeleoperator`; a device that gives no samples; a value that cannot be.
        UnknownNameError: no such controller of the plant's actuation.
    """
    checked_number(duration, "duration of the run [s]", above=0.0)
    checked_kind(plant, PlantConfig, "plant of the run")
    seed = checked_count(seed, "seed of the run")
    teleoperator = leader(
        robot,
        parameters=parameters,
        q_start=q_start,
        rotator=rotator,
        driver=driver,
        actuation=plant.commanded,
        solved_by=solved_by,
        servo_gains=(plant.servo.stiffness, plant.servo.damping),
    )
    check_period(teleoperator, plant.control_dt)
    if round(duration / plant.control_dt) < 1:
        got, wanted = f"{duration} s", f"{plant.control_dt} s"
        raise ConfigurationError("the run is shorter than a tick", got=got, wanted=wanted)
    usual = driver is None and leader is StepTeleoperator
    if recording is not None and not usual:
        what = "a run with a driver or a leader of its own cannot be recorded"
        raise ConfigurationError(what, got=(driver, leader))
    body = Plant(robot, plant, seed=seed)
    body.reset(q_start)
    source = device(teleoperator) if callable(device) else device
    teleoperator.device = checked_kind(source, Device, "the device that walks the robot")
    if isinstance(source, RecordedDevice):
        pushes = source.pushes or pushes
        played = source.recording.path
        if recording is not None and Path(recording).exists() and played.samefile(recording):
            what = "a recording that is played cannot be written over"
            raise ConfigurationError(what, got=str(recording), wanted="another file")
    pushes = _in_order(pushes)
    for number, force, seconds in pushes:
        body.push(robot.torso, force, seconds, number * plant.control_dt)
    controller, times = teleoperator.controller(), list[float]()
    # Of an unusual run there is nothing by which it could run again.
    setup = plant.control_dt
    if usual:
        setup = TeleopSetup.of(teleoperator, plant, seed=seed, rotator=rotator, q_start=q_start)
    recorder = TeleopRecorder(recording, teleoperator, setup, pushes=pushes)
    estimator = teleoperator.estimator
    ticks = rollout(
        body, controller, teleoperator, [recorder], estimator=estimator, duration=duration
    )
    begin = clock.perf_counter()
    with closing(ticks):
        for tick in ticks:
            times.append(tick.estimator_seconds + tick.leader_seconds + tick.controller_seconds)
    wall = clock.perf_counter() - begin
    record = recorder.record
    return TeleopRun(
        record=record,
        log=TeleopLog.of(record, plant.control_dt),
        plant=body,
        teleoperator=teleoperator,
        fell=body.fallen,
        clearance=float(record["clearance"].min()) if "clearance" in record else None,
        tick_us=1e6 * float(np.median(times)),
        real_time_factor=body.time / wall,
    )


def _in_order(pushes: Sequence[Push]) -> list[RecordedPush]:
    """Pushes in order of time, checked."""
    for push in checked_kind(pushes, Sequence, "pushes of the run"):
        if not (isinstance(push, tuple | list) and len(push) == 3):
            raise ConfigurationError(
                "a push is of the wrong kind", got=push, wanted="tick, force [N], and duration [s]"
            )
        checked_count(push[0], "the tick of a push")
    return sorted((RecordedPush(*push) for push in pushes), key=lambda push: push.tick)


def replay_teleop(
    recording: Recording | RunRecord | str | Path, robot: Robot | None = None
) -> TeleopRun:
    """Run a recording again: same robot, plant, seed and samples, hence the same commands.

    Args:
        recording: opened, or its file, or the record of a run.
        robot: of the recording; that of the catalog with its name when None.

    Raises:
        UnknownNameError: the catalog has no robot of that name.
        RecordingError: it cannot be read, lacks the set-up of a run, or is from another robot, or
            one of the same name with other masses, limits or soles.
    """
    if isinstance(recording, RunRecord):
        recording = recording_of(recording)
    elif not isinstance(recording, Recording):
        recording = read_recording(recording)
    name = recording.path.name
    if robot is None:
        robot = recorded_robot(recording.robot, f"the recording {name}", option="--robot FILE")
    if not recording.is_of(robot):
        same = robot.name == recording.robot
        raise RecordingError(
            f"the recording {name} is from another "
            + (f"{robot.name}: masses, limits or soles differ" if same else "robot"),
            got=recording.robot,
            wanted="the robot that it was made with, as `robot`" if same else robot.name,
        )
    setup = recording.setup
    return run_teleop(
        robot,
        RecordedDevice(recording),
        setup.plant,
        duration=recording.duration,
        seed=setup.seed,
        parameters=setup.parameters,
        rotator=setup.rotator,
        q_start=None if setup.q_start is None else np.array(setup.q_start),
        solved_by=setup.solved_by,
    )
