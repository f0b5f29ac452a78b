"""`run_teleop`: a device walks a simulated robot. `replay_teleop`: its recording, again."""

import time as clock
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_count, checked_kind, checked_number
from poise.apps.teleoperation._log import TeleopLog
from poise.apps.teleoperation._recording import (
    RecordedDevice,
    RecordedPush,
    Recording,
    TeleopRecorder,
    read_recording,
    recording_of,
)
from poise.apps.teleoperation._setup import RecordingError, TeleopSetup, recorded_robot
from poise.errors import ConfigurationError
from poise.locomotion import ComDriver, ComShifter, Device, StepTeleoperator, TeleopParameters
from poise.robots import Robot
from poise.sim import Plant, PlantConfig, RunRecord, check_period, rollout

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

# Makes a device for a teleoperator that has not begun: it knows where the feet stand
MakeDevice = Callable[[StepTeleoperator], Device]


@dataclass(frozen=True, kw_only=True, eq=False)
class TeleopRun:
    """A finished run.

    Attributes:
        record: of the run.
        log: columns of the operator's side, a row a tick.
        plant: as it was at the end.
        teleoperator: as it was at the end.
        fell: the robot fell, which ends a run.
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
        driver: moves the COM; the COM shifter when None.
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
