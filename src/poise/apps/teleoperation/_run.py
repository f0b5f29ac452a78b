"""`run_teleop`: the loop from device to controller to plant, without a person.

The plant that step teleoperation is simulated on.
`TeleopLog`: everything about a teleoperated run, a row a tick.
"""

import time as clock
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int8

from poise._checks import checked_number
from poise._schema import read
from poise.control import Command
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
    TeleopStatus,
    read_recording,
)
from poise.robots import Robot, load_robot
from poise.sim import (
    BlockWatch,
    Plant,
    PlantConfig,
    SensorConfig,
    ServoConfig,
)

TELEOP_PLANT = PlantConfig(
    actuation="velocity",
    control_dt=5e-3,
    physics_dt=1e-3,
    servo=ServoConfig(stiffness=70.0, damping=2.5),
)
"""Velocity servos with position feedback; physics 1 ms, control 5 ms, as Zhang and Kikuuwe have it.

The servos are stiff enough that the commanded velocity is the velocity: with those of a standing
robot that is commanded torques the ZMP lags by what the joints sag."""

REAL_SENSORS = SensorConfig(
    encoder_resolution=2.0 * np.pi / 2**17,
    joint_velocity_noise=0.01,
    base_orientation_noise=1e-3,
    gyro_noise=5e-3,
    force_noise=2.0,
    moment_noise=0.3,
)
"""Encoders of 17 bits, an inertial unit and load cells as one buys them; white noise."""


def noisy(plant: PlantConfig = TELEOP_PLANT) -> PlantConfig:
    """The plant with `REAL_SENSORS`."""
    return replace(plant, sensors=REAL_SENSORS)


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
"""Likewise the device's status."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TeleopLog:
    """Signals of one run, T ticks. Positions are in the world as the controller estimates it.

    Attributes:
        time: before the tick [s].
        mode: place in `MODES`.
        device: place in `DEVICE_STATUSES`.
        hands: left and right device, NaN where no sample came [m].
        zmp: measured, smoothed [m].
        zmp_reference: of it [m].
        cart_table_zmp: CT-ZMP [m].
        com: [m].
        soles: left and right [m].
        target: of the foot in the air, NaN with both on the ground [m].
        loads: left and right [N].
        tilt: of the torso [rad].
        velocity: commanded, each joint [rad/s].
        q: true configuration before the tick [m, rad].
        touched: whether any part of the robot touched a block.
    """

    time: Float64[np.ndarray, " T"]
    mode: Int8[np.ndarray, " T"]
    device: Int8[np.ndarray, " T"]
    hands: Float64[np.ndarray, "T 2 3"]
    zmp: Float64[np.ndarray, "T 2"]
    zmp_reference: Float64[np.ndarray, "T 2"]
    cart_table_zmp: Float64[np.ndarray, "T 2"]
    com: Float64[np.ndarray, "T 3"]
    soles: Float64[np.ndarray, "T 2 3"]
    target: Float64[np.ndarray, "T 3"]
    loads: Float64[np.ndarray, "T 2"]
    tilt: Float64[np.ndarray, " T"]
    velocity: Float64[np.ndarray, "T nj"]
    q: Float64[np.ndarray, "T nq"]
    touched: Bool[np.ndarray, " T"]

    def __len__(self) -> int:
        return len(self.time)

    def when(self, mode: Mode) -> Bool[np.ndarray, " T"]:
        """Ticks in a mode."""
        return self.mode == MODES.index(mode)

    def entries(self, mode: Mode) -> Float64[np.ndarray, " n"]:
        """Times at which a mode was entered [s]."""
        now = self.when(mode)
        return self.time[now & ~np.concatenate(([False], now[:-1]))]


class LogWriter:
    """Fills a log tick by tick.

    Args:
        plant: whose run.
        ticks: how many there are at most.
    """

    def __init__(self, plant: Plant, ticks: int) -> None:
        robot = plant.robot
        shapes = {
            "time": (), "hands": (2, 3), "zmp": (2,), "zmp_reference": (2,),
            "cart_table_zmp": (2,), "com": (3,), "soles": (2, 3), "target": (3,), "loads": (2,),
            "tilt": (), "velocity": (robot.nj,), "q": (robot.nq,),
        }  # fmt: skip
        self._columns = {k: np.full((ticks, *shape), np.nan) for k, shape in shapes.items()}
        self._codes = {k: np.zeros(ticks, dtype=np.int8) for k in ("mode", "device")}
        self._touched = np.zeros(ticks, dtype=np.bool_)
        self._count = 0

    def add(
        self,
        plant: Plant,
        status: TeleopStatus,
        command: Command,
        *,
        touched: bool,
    ) -> None:
        """Adds a tick, before the plant moves."""
        i, columns = self._count, self._columns
        columns["time"][i] = plant.time
        if status.sample is not None:
            columns["hands"][i] = status.sample.left, status.sample.right
        for name in ("zmp", "zmp_reference", "cart_table_zmp", "com", "soles", "loads", "tilt"):
            columns[name][i] = getattr(status, name)
        if status.target is not None:
            columns["target"][i] = status.target
        columns["velocity"][i] = command.velocity
        columns["q"][i] = plant.map.q(plant.data.qpos)
        self._codes["mode"][i] = MODES.index(status.mode)
        self._codes["device"][i] = DEVICE_STATUSES.index(status.device)
        self._touched[i] = touched
        self._count += 1

    def finish(self) -> TeleopLog:
        """The log so far."""
        n = self._count
        parts = self._columns | self._codes | {"touched": self._touched}
        return TeleopLog(**{name: column[:n].copy() for name, column in parts.items()})


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
    rotator: bool = True,
    driver: ComDriver | None = None,
    q_start: Float64[np.ndarray, " nq"] | None = None,
    recording: Path | None = None,
    leader: type[StepTeleoperator] = StepTeleoperator,
) -> TeleopRun:
    """Walks a simulated robot by a device.

    Args:
        robot: a biped.
        device: gives samples, or makes what gives them from the controller.
        plant: with velocity actuation, and the controller's tick.
        duration: [s]; a fall ends the run earlier.
        seed: of the sensor noise.
        parameters: scaled to the robot when None.
        rotator: whether the body rotator acts.
        driver: moves the COM; the COM shifter when None.
        q_start: configuration at the start; the robot's home when None.
        recording: file to write, from which `replay_teleop` runs the same again.
        leader: leads by rules of its own, for studies.

    Raises:
        ConfigurationError: the plant takes no velocities or has another tick.
    """
    checked_number(duration, "duration of the run [s]", above=0.0)
    controller = leader(
        robot, parameters=parameters, q_start=q_start, rotator=rotator, driver=driver
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
    if recording is not None and (driver is not None or leader is not StepTeleoperator):
        raise ConfigurationError(
            "a run with a driver or a leader of its own cannot be recorded",
            got=(driver, leader.__name__),
        )
    body = Plant(robot, plant, seed=seed)
    if q_start is not None:
        body.reset(q_start)
    controller.device = device(controller) if callable(device) else device
    setup = _setup(controller, plant, seed, duration, rotator=rotator, q_start=q_start)
    notes = (
        nullcontext()
        if recording is None
        else RecordingWriter(recording, robot=robot.name, dt=plant.control_dt, setup=setup)
    )
    with notes as writer:
        return _loop(controller, body, duration, writer)


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
        "rotator": rotator,
        "plant": plant_to_json(plant),
        "seed": seed,
        "duration": duration,
        "q_start": None if q_start is None else q_start.tolist(),
    }


def _loop(
    controller: StepTeleoperator,
    plant: Plant,
    duration: float,
    writer: RecordingWriter | None,
) -> TeleopRun:
    solver, device = controller.controller(), controller.device
    ticks = round(duration / plant.config.control_dt)
    log, times = LogWriter(plant, ticks), np.zeros(ticks)
    watch = BlockWatch(plant) if plant.config.blocks else None
    clearance, done = np.inf, 0
    begin = clock.perf_counter()
    for tick in range(ticks):
        state = plant.state()
        start = clock.perf_counter()
        state = controller.estimator.update(state)
        controller.lead(state)
        command = solver.step(state)
        times[tick] = clock.perf_counter() - start
        sample = None if controller.status is None else controller.status.sample
        if writer is not None and sample is not None:
            writer.sample(tick, sample)
        if isinstance(device, RecordedDevice):
            for force, seconds in device.pushes:
                x, y, z = force.tolist()
                plant.push(plant.robot.torso, (x, y, z), seconds)
        done = tick + 1
        touched = False
        if watch is not None:
            touched, clearance = watch.touched(), min(clearance, watch.clearance())
        if controller.status is not None:
            log.add(plant, controller.status, command, touched=touched)
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
