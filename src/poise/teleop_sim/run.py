"""`run_teleop`: the loop from device to controller to plant, without a person."""

import time as clock
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.checks import checked_number
from poise.errors import ConfigurationError
from poise.robots import load_robot
from poise.robots.robot import Robot
from poise.sim import BlockWatch, Plant, PlantConfig
from poise.teleop import (
    ComDriver,
    Device,
    RecordedDevice,
    Recording,
    RecordingError,
    RecordingWriter,
    Rules,
    StepTeleoperator,
    TeleopParameters,
    read_recording,
)
from poise.teleop_sim.log import LogWriter, TeleopLog
from poise.teleop_sim.plant import TELEOP_PLANT, plant_from_json, plant_to_json

MakeDevice = Callable[[StepTeleoperator], Device]
"""Makes a device for a controller that has not begun: it knows where the feet stand."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TeleopRun:
    """A finished run.

    Attributes:
        log: everything, a row a tick.
        plant: as it was left.
        controller: as it was left.
        fell: whether the robot fell; the run ends there.
        clearance: smallest distance of any part of the robot from a block [m]; None without blocks.
        tick_us: median time of one control step [us].
        real_time_factor: simulated over elapsed time.
    """

    log: TeleopLog
    plant: Plant = field(repr=False)
    controller: StepTeleoperator = field(repr=False)
    fell: bool
    clearance: float | None
    tick_us: float
    real_time_factor: float


def run_teleop(
    robot: Robot,
    device: Device | MakeDevice,
    plant: PlantConfig = TELEOP_PLANT,
    *,
    duration: float,
    seed: int = 0,
    parameters: TeleopParameters | None = None,
    rules: Rules | None = None,
    rotator: bool = True,
    driver: ComDriver | None = None,
    q_start: Float64[np.ndarray, " nq"] | None = None,
    recording: Path | None = None,
) -> TeleopRun:
    """Walks a simulated robot by a device.

    Args:
        robot: a biped.
        device: gives samples, or makes what gives them from the controller.
        plant: with velocity actuation, and the controller's tick.
        duration: [s]; a fall ends the run earlier.
        seed: of the sensor noise.
        parameters: scaled to the robot when None.
        rules: departures from the paper; the default ones when None.
        rotator: whether the body rotator acts.
        driver: moves the COM; the COM shifter when None.
        q_start: configuration at the start; the robot's home when None.
        recording: file to write, from which `replay_teleop` runs the same again.

    Raises:
        ConfigurationError: the plant takes no velocities or has another tick.
    """
    checked_number(duration, "duration of the run [s]", above=0.0)
    controller = StepTeleoperator(
        robot, parameters, q_start=q_start, rules=rules, rotator=rotator, driver=driver
    )
    if plant.actuation != "velocity":
        raise ConfigurationError(
            "step teleoperation commands velocities", got=plant.actuation, wanted="velocity"
        )
    if plant.control_dt != controller.parameters.dt:
        raise ConfigurationError(
            "controller and plant have different ticks",
            got=(controller.parameters.dt, plant.control_dt),
            wanted="the same",
        )
    if recording is not None and driver is not None:
        raise ConfigurationError("a run with a driver of its own cannot be recorded", got=driver)
    body = Plant(robot, plant, seed=seed)
    if q_start is not None:
        body.reset(q_start)
    source: Device = device(controller) if callable(device) else device
    setup = _setup(controller, plant, seed, duration, rotator=rotator, q_start=q_start)
    notes = (
        nullcontext()
        if recording is None
        else RecordingWriter(recording, robot=robot.name, dt=plant.control_dt, setup=setup)
    )
    with notes as writer:
        return _loop(controller, source, body, duration, writer)


def replay_teleop(recording: Recording | Path, robot: Robot | None = None) -> TeleopRun:
    """Runs a recording again: same robot, plant, seed and samples, hence the same commands.

    Args:
        recording: opened, or its file.
        robot: of the recording; loaded by its name when None.

    Raises:
        RecordingError: it cannot be read, is from another robot, or lacks the set-up of a run.
    """
    if isinstance(recording, Path):
        recording = read_recording(recording)
    robot = load_robot(recording.robot) if robot is None else robot
    device = recording.device(robot=robot.name, dt=recording.dt)
    setup = recording.setup
    try:
        parameters = TeleopParameters(**setup["parameters"])
        rules = Rules(**setup["rules"])
        plant = plant_from_json(setup["plant"])
        q_start = None if setup["q_start"] is None else np.array(setup["q_start"])
        seed, duration, rotator = setup["seed"], setup["duration"], setup["rotator"]
    except (KeyError, TypeError) as error:
        raise RecordingError(
            f"the recording {recording.path.name} lacks the set-up of a run",
            got=f"{type(error).__name__}: {error}",
            wanted="one that run_teleop has written",
        ) from None
    return run_teleop(
        robot,
        device,
        plant,
        duration=duration,
        seed=seed,
        parameters=parameters,
        rules=rules,
        rotator=rotator,
        q_start=q_start,
    )


def teleop_setup(
    controller: StepTeleoperator,
    plant: PlantConfig,
    *,
    seed: int,
    duration: float,
    rotator: bool = True,
    q_start: Float64[np.ndarray, " nq"] | None = None,
) -> dict[str, Any]:
    """What a recording's header needs so that `replay_teleop` can run it again.

    Args:
        controller: that drives the robot.
        plant: of the run.
        seed: of the sensor noise.
        duration: of the run [s]; a live run may give a long one: a replay ends there.
        rotator: whether the body rotator acts.
        q_start: configuration at the start; None for the robot's home.
    """
    return _setup(controller, plant, seed, duration, rotator=rotator, q_start=q_start)


def _setup(
    controller: StepTeleoperator,
    plant: PlantConfig,
    seed: int,
    duration: float,
    *,
    rotator: bool,
    q_start: Float64[np.ndarray, " nq"] | None,
) -> dict[str, Any]:
    return {
        "parameters": asdict(controller.parameters),
        "rules": asdict(controller.rules),
        "rotator": rotator,
        "plant": plant_to_json(plant),
        "seed": seed,
        "duration": duration,
        "q_start": None if q_start is None else q_start.tolist(),
    }


def _loop(
    controller: StepTeleoperator,
    device: Device,
    plant: Plant,
    duration: float,
    writer: RecordingWriter | None,
) -> TeleopRun:
    ticks = round(duration / plant.config.control_dt)
    log, times = LogWriter(plant, ticks), np.zeros(ticks)
    watch = BlockWatch(plant) if plant.config.blocks else None
    clearance, done = np.inf, 0
    begin = clock.perf_counter()
    for tick in range(ticks):
        state, sample = plant.state(), device.sample(plant.time)
        if writer is not None and sample is not None:
            writer.sample(tick, sample)
        if isinstance(device, RecordedDevice):
            for force, seconds in device.pushes:
                x, y, z = force.tolist()
                plant.push(plant.robot.torso, (x, y, z), seconds)
        start = clock.perf_counter()
        command = controller.step(state, sample)
        times[tick] = clock.perf_counter() - start
        done = tick + 1
        touched = False
        if watch is not None:
            touched, clearance = watch.touched(), min(clearance, watch.clearance())
        if controller.status is not None:
            log.add(plant, sample, controller.status, command, touched=touched)
        plant.step(command)
        if plant.fallen:
            break
    wall = clock.perf_counter() - begin
    return TeleopRun(
        log=log.finish(),
        plant=plant,
        controller=controller,
        fell=plant.fallen,
        clearance=float(clearance) if watch is not None else None,
        tick_us=1e6 * float(np.median(times[:done])),
        real_time_factor=plant.time / wall,
    )
