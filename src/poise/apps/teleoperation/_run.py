"""`run_teleop`: a rollout in which a device walks the robot, without a person.

The plant that step teleoperation is simulated on.
`TeleopLog`: what its record says of the operator's side, a row a tick.
"""

import time as clock
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int8

from poise._checks import checked_count, checked_kind, checked_number
from poise._schema import read
from poise.apps.teleoperation._digest import robot_digest
from poise.errors import ConfigurationError
from poise.locomotion import (
    ComDriver,
    Device,
    DeviceStatus,
    Mode,
    RecordedDevice,
    Recording,
    RecordingError,
    RecordingWriter,
    StepTeleoperator,
    TeleopParameters,
    read_recording,
)
from poise.robots import Robot, load_robot
from poise.sim import (
    Plant,
    PlantConfig,
    Recorder,
    RunRecord,
    check_period,
    rollout,
)

VELOCITY_TELEOP_PLANT = PlantConfig(
    actuation="velocity",
    control_dt=5e-3,
    physics_dt=1e-3,
    servo=PlantConfig.Servo(
        stiffness=TeleopParameters().servo_stiffness, damping=TeleopParameters().servo_damping
    ),
)
"""Velocity servos with position feedback; physics 1 ms, control 5 ms, as Zhang and Kikuuwe have it.

The servos are stiff enough that the commanded velocity is the velocity: with those of a standing
robot that is commanded torques the ZMP lags by what the joints sag."""

TORQUE_TELEOP_PLANT = PlantConfig(actuation="torque", control_dt=2e-3, physics_dt=1e-3)
"""Torques, and the tick of the step teleoperator that commands them."""


def plant_to_json(config: PlantConfig) -> dict[str, Any]:
    """A plant as plain numbers and texts, for a recording."""
    return asdict(config)


def plant_from_json(data: dict[str, Any]) -> PlantConfig:
    """The plant that `plant_to_json` wrote.

    Raises:
        RecordingError: it is none: a key is unknown, or a value cannot be.
    """
    return read(PlantConfig, data, "the plant of the recording", error=RecordingError)


MODES = tuple(Mode)
"""The number of a mode in a log is its place here."""
DEVICE_STATUSES = tuple(DeviceStatus)
"""The number of a device's status in a log is its place here."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TeleopLog:
    """A teleoperated run as its operator's side sees it: columns of its record, T ticks.

    Positions are in the world as the teleoperator estimates it.

    Attributes:
        time: before the tick [s].
        mode: place in `tuple(Mode)`.
        device: place in `tuple(DeviceStatus)`.
        devices: left and right, NaN where no sample came [m].
        zmp: measured, smoothed [m].
        zmp_reference: of it [m].
        cart_table_zmp: CT-ZMP [m].
        com: [m].
        soles: left and right [m].
        target: of the foot in the air, NaN with both on the ground [m].
        loads: left and right [N].
        tilt: of the torso [rad].
        command: velocity [rad/s] or torque [N m] commanded, each joint.
        q: true configuration after the tick [m, rad].
        touched: whether any solid part of the robot touched a block after the tick; links that the
            robot's document only draws go through blocks, those of `biped20` and `humanoid33` too.
    """

    time: Float64[np.ndarray, " T"]
    mode: Int8[np.ndarray, " T"]
    device: Int8[np.ndarray, " T"]
    devices: Float64[np.ndarray, "T 2 3"]
    zmp: Float64[np.ndarray, "T 2"]
    zmp_reference: Float64[np.ndarray, "T 2"]
    cart_table_zmp: Float64[np.ndarray, "T 2"]
    com: Float64[np.ndarray, "T 3"]
    soles: Float64[np.ndarray, "T 2 3"]
    target: Float64[np.ndarray, "T 3"]
    loads: Float64[np.ndarray, "T 2"]
    tilt: Float64[np.ndarray, " T"]
    command: Float64[np.ndarray, "T nj"]
    q: Float64[np.ndarray, "T nq"]
    touched: Bool[np.ndarray, " T"]

    @classmethod
    def of(cls, record: RunRecord, dt: float) -> "TeleopLog":
        """The log of a record.

        Args:
            record: of a rollout that a step teleoperator led.
            dt: length of a tick [s].
        """
        # A state that the teleoperator cannot use before it began leaves no status: no row.
        end = record.times("zmp_reference")
        rows = np.isin(record.times("q"), end)
        touched = record["touched"][rows] if "touched" in record else np.zeros(len(end), np.bool_)
        command = record["command_torque" if "command_torque" in record else "command_velocity"]
        devices = (record[f"target/{side} device"][rows] for side in ("left", "right"))
        return cls(
            time=dt * (np.round(end / dt) - 1.0),
            mode=_places(record.notes("mode"), [mode.name for mode in MODES], end),
            device=_places(record.notes("device"), [d.name for d in DEVICE_STATUSES], end),
            devices=np.stack(tuple(devices), axis=1),
            zmp=record["estimate/zmp"],
            zmp_reference=record["zmp_reference"],
            cart_table_zmp=record["estimate/cart_table_zmp"],
            com=record["estimate/com"],
            soles=record["estimate/soles"],
            target=record["foot_target"],
            loads=record["estimate/loads"],
            tilt=record["estimate/tilt"],
            command=command[rows],
            q=record["q"][rows],
            touched=touched,
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


Push = tuple[int, tuple[float, float, float], float]
"""Tick, force [N] and duration [s] of a push, as recordings have it."""

MakeDevice = Callable[[StepTeleoperator], Device]
"""Makes a device for a teleoperator that has not begun: it knows where the feet stand."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TeleopRun:
    """A finished run.

    Attributes:
        record: of the run.
        log: what it says of the operator's side, a row a tick.
        plant: as it was left.
        teleoperator: as it was left.
        fell: whether the robot fell; the run ends there.
        clearance: smallest distance of any solid part of the robot from a block, up to 0.2 m [m];
            None without blocks.
        tick_us: median time of one control step [us].
        real_time_factor: simulated over elapsed time.
    """

    record: RunRecord = field(repr=False)
    log: TeleopLog
    plant: Plant = field(repr=False)
    teleoperator: StepTeleoperator = field(repr=False)
    fell: bool
    clearance: float | None
    tick_us: float
    real_time_factor: float


def run_teleop(
    robot: Robot,
    device: Device | MakeDevice,
    plant: PlantConfig = TORQUE_TELEOP_PLANT,
    *,
    duration: float,
    seed: int = 0,
    parameters: TeleopParameters | None = None,
    rotator: bool = True,
    driver: ComDriver | None = None,
    q_start: Float64[np.ndarray, " nq"] | None = None,
    recording: str | Path | None = None,
    leader: type[StepTeleoperator] = StepTeleoperator,
    pushes: Sequence[Push] = (),
    solved_by: str | None = None,
) -> TeleopRun:
    """Walks a simulated robot by a device.

    Args:
        robot: a biped.
        device: gives samples, or makes what gives them from the teleoperator.
        plant: takes what the teleoperator is to command, at its tick: torques, or velocities.
        duration: [s]; a fall ends the run earlier.
        seed: of the sensor noise.
        parameters: scaled to the robot when None.
        rotator: whether the body rotator acts.
        driver: moves the COM; the COM shifter when None.
        q_start: configuration at the start; the robot's home when None.
        recording: file to write, from which `replay_teleop` runs the same again.
        leader: leads by rules of its own, for studies.
        pushes: on the torso: the tick at whose beginning, the force in the world [N], how long [s].
            Those of a recording come by themselves.
        solved_by: name of the controller that solves the stack, see `StepTeleoperator`.

    Raises:
        ConfigurationError: the plant has another tick; the robot cannot be walked, see
            `StepTeleoperator`; a device that gives no samples; a value that cannot be.
        UnknownNameError: no such controller of what the plant takes.
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
        actuation=plant.actuation,
        solved_by=solved_by,
    )
    check_period(teleoperator, plant.control_dt)
    if round(duration / plant.control_dt) < 1:
        raise ConfigurationError(
            "the run is shorter than a tick", got=f"{duration} s", wanted=f"{plant.control_dt} s"
        )
    if recording is not None and (driver is not None or leader is not StepTeleoperator):
        raise ConfigurationError(
            "a run with a driver or a leader of its own cannot be recorded",
            got=(driver, leader.__name__),
        )
    body = Plant(robot, plant, seed=seed)
    body.reset(q_start)
    source = device(teleoperator) if callable(device) else device
    teleoperator.device = checked_kind(source, Device, "the device that walks the robot")
    if isinstance(source, RecordedDevice):
        pushes = source.recording.pushes
        _check_another_file(recording, source.recording)
    pushes = _in_order(pushes)
    for number, force, seconds in pushes:
        body.push(robot.torso, force, seconds, number * plant.control_dt)
    setup = teleop_setup(
        teleoperator, plant, seed=seed, duration=duration, rotator=rotator, q_start=q_start
    )
    writing = (
        nullcontext()
        if recording is None
        else RecordingWriter(recording, robot=robot.name, dt=plant.control_dt, setup=setup)
    )
    recorder, times, coming = Recorder(), list[float](), deque(pushes)
    begin = clock.perf_counter()
    with writing as writer:
        for tick in rollout(
            body,
            teleoperator.controller(),
            teleoperator,
            [recorder],
            estimator=teleoperator.estimator,
            duration=duration,
        ):
            times.append(tick.estimator_seconds + tick.leader_seconds + tick.controller_seconds)
            if writer is not None and teleoperator.status is not None:
                while coming and coming[0][0] <= tick.index:
                    begins, force, seconds = coming.popleft()
                    writer.push(begins, np.array(force), seconds)
                writer.sample(tick.index, teleoperator.status.sample)
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


def _check_another_file(recording: str | Path | None, played: Recording) -> None:
    """A recording is read as it is played: written over, it would end the process.

    Raises:
        ConfigurationError: it would be.
    """
    if recording is not None and Path(recording).exists() and played.path.samefile(recording):
        raise ConfigurationError(
            "a recording that is played cannot be written over",
            got=str(recording),
            wanted="another file",
        )


def _in_order(pushes: Sequence[Push]) -> list[Push]:
    """Pushes in order of time.

    Raises:
        ConfigurationError: one is none.
    """
    for push in checked_kind(pushes, Sequence, "pushes of the run"):
        if not (isinstance(push, tuple | list) and len(push) == 3):
            raise ConfigurationError(
                "a push is of the wrong kind", got=push, wanted="tick, force [N], and duration [s]"
            )
        checked_count(push[0], "the tick of a push")
    return sorted(pushes, key=lambda push: push[0])


def replay_teleop(recording: Recording | str | Path, robot: Robot | None = None) -> TeleopRun:
    """Runs a recording again: same robot, plant, seed and samples, hence the same commands.

    Args:
        recording: opened, or its file.
        robot: of the recording; loaded by its name when None.

    Raises:
        RecordingError: it cannot be read, is from another robot, also one of the same name that
            carries something else, or lacks the set-up of a run.
    """
    if not isinstance(recording, Recording):
        recording = read_recording(recording)
    robot = load_robot(recording.robot) if robot is None else robot
    device = recording.device(robot=robot.name, dt=recording.dt)
    setup = recorded_setup(recording, robot)
    return run_teleop(
        robot,
        device,
        setup.plant,
        duration=setup.duration,
        seed=setup.seed,
        parameters=setup.parameters,
        rotator=setup.rotator,
        q_start=setup.q_start,
        solved_by=setup.solved_by,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedSetup:
    """What a recording was made with, beside its robot.

    Attributes:
        parameters: of the teleoperator.
        rotator: whether the body rotator acts.
        plant: of the run.
        seed: of the sensor noise.
        duration: of the run [s].
        q_start: configuration at the start; None for the robot's home.
        solved_by: name of the controller that solved the stack; None for the usual one.
        digest: of the robot, see `robot_digest`; None where the recording does not say.
    """

    parameters: TeleopParameters
    rotator: bool
    plant: PlantConfig
    seed: int
    duration: float
    q_start: Float64[np.ndarray, " nq"] | None
    solved_by: str | None
    digest: str | None


def recorded_setup(recording: Recording, robot: Robot) -> RecordedSetup:
    """What a recording was made with.

    Args:
        recording: of `run_teleop` or of a live run.
        robot: that shall do the same again.

    Raises:
        RecordingError: it does not say, or the robot has the same name and is another one.
    """
    made = _read_setup(recording)
    same_name = recording.robot == robot.name
    if same_name and made.digest not in (None, robot_digest(robot)):
        raise RecordingError(
            f"the recording {recording.path.name} is from another {robot.name}: masses, limits or "
            "soles differ, and commands would",
            wanted="the robot that it was made with, as `robot`",
        )
    return made


def _read_setup(recording: Recording) -> RecordedSetup:
    setup = recording.setup
    try:
        return RecordedSetup(
            parameters=TeleopParameters(**setup["parameters"]),
            rotator=setup["rotator"],
            plant=plant_from_json(setup["plant"]),
            seed=setup["seed"],
            duration=setup["duration"],
            q_start=None if setup["q_start"] is None else np.array(setup["q_start"]),
            # The first recordings do not say.
            solved_by=setup.get("solved_by"),
            digest=setup.get("digest"),
        )
    except (KeyError, TypeError) as error:
        raise RecordingError(
            f"the recording {recording.path.name} lacks the set-up of a run",
            got=f"{type(error).__name__}: {error}",
            wanted="one that run_teleop has written",
        ) from None


def teleop_setup(
    teleoperator: StepTeleoperator,
    plant: PlantConfig,
    *,
    seed: int,
    duration: float,
    rotator: bool = True,
    q_start: Float64[np.ndarray, " nq"] | None = None,
) -> dict[str, Any]:
    """What a recording's header needs so that `replay_teleop` can run it again.

    Args:
        teleoperator: that walks the robot.
        plant: of the run.
        seed: of the sensor noise.
        duration: of the run [s]; a live run may give a long one: a replay ends there.
        rotator: whether the body rotator acts.
        q_start: configuration at the start; None for the robot's home.
    """
    return {
        "parameters": asdict(teleoperator.parameters),
        "rotator": rotator,
        "plant": plant_to_json(plant),
        "seed": seed,
        "duration": duration,
        "q_start": None if q_start is None else np.asarray(q_start).tolist(),
        "solved_by": teleoperator.solved_by,
        "digest": robot_digest(teleoperator.robot),
    }
