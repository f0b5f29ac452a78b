"""`Recording` of a run, `TeleopRecorder` that makes it, `RecordedDevice` that sends its samples."""

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from jaxtyping import Float64
from msgspec.structs import replace

from poise._schema import Positive, checked, read
from poise.errors import (
    ConfigurationError,
    MissingExtraError,
    PoiseError,
    RobotError,
    UnknownNameError,
)
from poise.locomotion import OperatorSample, StepTeleoperator, TeleopParameters, TrackedPose
from poise.robots import Robot, find_entry, load_robot
from poise.sim import PlantConfig, Recorder, RecorderConfig, RunRecord, Tick, read_log, write_log

SAMPLES, PUSHES = "operator", "push"  # Topics of the messages that hold samples and pushes

# Keys of a record: a `TeleopSetup` in JSON, or its `dt` alone; length of the run [s]
_SETUP, _DURATION = "teleoperation", "duration"


class RecordingError(PoiseError):
    """A recording that cannot be read or does not belong to this robot."""


@checked(RecordingError)
@dataclass(frozen=True, kw_only=True)
class TeleopSetup:
    """Settings of a run beside its robot."""

    parameters: TeleopParameters  # of the teleoperator
    plant: PlantConfig  # of the run
    seed: int  # of the sensor noise
    dt: Positive  # length of a tick [s]
    rotator: bool = True  # whether the body rotator acts
    q_start: tuple[float, ...] | None = None  # configuration at the start
    solved_by: str | None = None  # name of the controller that solves the stack
    digest: str | None = None  # of the robot, see `robot_digest`
    height: Positive | None = None  # of the CoM over the soles at the start [m]

    @classmethod
    def of(
        cls,
        teleoperator: StepTeleoperator,
        plant: PlantConfig,
        *,
        seed: int,
        rotator: bool = True,
        q_start: Float64[np.ndarray, " nq"] | None = None,
    ) -> "TeleopSetup":
        return cls(
            parameters=teleoperator.parameters,
            plant=plant,
            seed=seed,
            dt=plant.control_dt,
            rotator=rotator,
            q_start=None if q_start is None else tuple(np.asarray(q_start).tolist()),
            solved_by=teleoperator.solved_by,
            digest=robot_digest(teleoperator.robot),
            height=com_height(teleoperator),
        )


class RecordedPush(NamedTuple):
    """A push on the torso."""

    tick: int  # at whose beginning
    force: tuple[float, float, float]  # in the world [N]
    duration: float  # how long [s]


class RecordedSample(NamedTuple):
    """A sample, as a log holds it."""

    tick: int  # before which it came
    sample: OperatorSample  # as it came


_ENCODE = msgspec.msgpack.Encoder().encode
_SAMPLE = msgspec.msgpack.Decoder(RecordedSample)
_PUSH = msgspec.msgpack.Decoder(RecordedPush)


class TeleopRecorder(Recorder):
    """Record a teleoperated run with all its inputs; pushes when they begin."""

    def __init__(
        self,
        path: str | Path | None,
        teleoperator: StepTeleoperator,
        setup: TeleopSetup | float,
        *,
        pushes: list[RecordedPush] | None = None,
        config: RecorderConfig | None = None,
        metadata: dict[str, str] | None = None,
    ) -> None:
        known = asdict(setup) if isinstance(setup, TeleopSetup) else {"dt": setup}
        texts = {_SETUP: json.dumps(known)} | (metadata or {})
        super().__init__(path, config=config, metadata=texts)
        self._teleoperator, self._coming = teleoperator, [] if pushes is None else pushes
        self._dt, self._ticks = float(known["dt"]), 0

    def observe(self, tick: Tick) -> None:
        """Record the tick, if it is due, and always its sample and pushes."""
        while self._coming and self._coming[0].tick <= tick.index:
            self.message(PUSHES, _ENCODE(self._coming.pop(0)))
        status = self._teleoperator.status
        if status is not None and status.sample is not None:
            self.message(SAMPLES, _ENCODE(RecordedSample(tick.index, status.sample)))
        self._ticks = tick.index + 1
        super().observe(tick)

    def end(self) -> None:
        """Finish the log."""
        self.record.metadata[_DURATION] = repr(self._ticks * self._dt)
        super().end()


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """Everything that came from outside a recorded run."""

    path: Path  # the file; that of a record in memory is ""
    robot: str  # the robot's name
    dt: float  # length of a tick [s]
    duration: float  # of the run [s]
    settings: dict[str, Any] = field(repr=False)  # fields of a `TeleopSetup` as recorded
    pushes: list[RecordedPush] = field(repr=False)  # on the torso, in order of time
    messages: list[bytes] = field(repr=False)  # of the samples, see `RecordedSample`

    @property
    def samples(self) -> list[RecordedSample]:
        return [_SAMPLE.decode(content) for content in self.messages]

    @property
    def setup(self) -> TeleopSetup:
        where = f"the set-up of the recording {self.path.name}"
        return read(TeleopSetup, self.settings, where, error=RecordingError)

    def is_of(self, robot: Robot) -> bool:
        """Return whether a robot has the name, masses, limits and soles of the recorded one."""
        digest = self.settings.get("digest")
        return robot.name == self.robot and digest in (None, robot_digest(robot))

    def setup_for(self, robot: Robot, actuation: str) -> TeleopSetup | None:
        """Return the settings with which a robot that starts at home repeats the run, if it can."""
        if "parameters" not in self.settings or not self.is_of(robot):
            return None
        made = self.setup
        return made if made.q_start is None and made.plant.actuation == actuation else None

    def device(self, teleoperator: StepTeleoperator) -> "RecordedDevice":
        """Return a device that sends the samples to a teleoperator that has not begun."""
        if not self.messages:
            raise RecordingError(f"the recording {self.path.name} has no samples of an operator")
        same = self.is_of(teleoperator.robot) and teleoperator.dt == self.dt
        same = same and self.settings.get("q_start") is None
        return RecordedDevice(self, None if same else teleoperator)


class RecordedDevice:
    """Send the samples of a recording at their ticks; call `sample` once a tick."""

    def __init__(self, recording: Recording, teleoperator: StepTeleoperator | None = None) -> None:
        self.recording, self._teleoperator = recording, teleoperator
        self.pushes = recording.pushes if teleoperator is None else []
        self._scale = self._per_tick = 1.0
        if teleoperator is not None:
            height = com_height(teleoperator)
            # Without a recorded height of the CoM, displacements are not scaled.
            self._scale = height / (recording.settings.get("height") or height)
            self._per_tick = recording.dt / teleoperator.dt
        self._offsets = [np.zeros(3), np.zeros(3)]
        self._coming = map(_SAMPLE.decode, recording.messages)
        self._next, self._tick = next(self._coming, None), 0

    def sample(self, time: float) -> OperatorSample | None:
        """Sample that came before the next tick."""
        del time
        found = None
        while self._next is not None and self._next.tick * self._per_tick <= self._tick:
            found, self._next = self._next.sample, next(self._coming, None)
        self._tick += 1
        if found is None or self._teleoperator is None:
            return found
        left, right = (self._transferred(foot, found.feet[foot]) for foot in (0, 1))
        body = replace(found.body, height=self._scale * found.body.height)
        return replace(found, feet=(left, right), body=body)

    def _transferred(self, foot: int, part: TrackedPose | None) -> TrackedPose | None:
        """Scale a foot's device by the heights of both robots' CoM, and shift it to the foot."""
        teleoperator = self._teleoperator
        if teleoperator is None or part is None or part.position is None:
            return part
        place = self._scale * np.array(part.position)
        if not teleoperator.held[foot] and math.isfinite(place.sum()):
            self._offsets[foot][:2] = teleoperator.estimator.sole(foot)[:2] - place[:2]
        rate = None if part.velocity is None else self._scale * np.array(part.velocity)
        place = place + self._offsets[foot]
        return TrackedPose.of(place, part.clutch, part.orientation, velocity=rate)


def read_recording(path: str | Path, *, allow_partial: bool = False) -> Recording:
    """Open a recording."""
    path = Path(path)
    try:
        record = read_log(path, (SAMPLES, PUSHES))
    except MissingExtraError:
        raise
    except PoiseError as error:
        raise RecordingError(f"{path.name} is no recording: {error}") from None
    if not (record.complete or allow_partial):
        wanted = "read_recording(path, allow_partial=True), which has what there is"
        raise RecordingError(f"the recording {path.name} was not finished", wanted=wanted)
    return recording_of(record, path)


def recording_of(record: RunRecord, path: Path = Path()) -> Recording:
    """Operator's part of a record."""
    try:
        settings = json.loads(record.metadata[_SETUP])
        robot, dt = record.metadata["robot"], float(settings["dt"])
        if not 0.0 < dt < 1.0:
            raise ValueError(f"a tick of {dt} s")
    except (KeyError, ValueError, TypeError) as error:
        raise RecordingError(
            f"{path.name} is no recording of a teleoperated run",
            got=f"{type(error).__name__}: {error}",
            wanted="the log of one, which has its set-up",
        ) from None
    messages = [content for _, content in record.messages(SAMPLES)]
    pushed = [content for _, content in record.messages(PUSHES)]
    last = _last_tick(f"samples of {path.name}", messages, _SAMPLE.decode)
    last = max(last, _last_tick(f"pushes of {path.name}", pushed, _PUSH.decode))
    return Recording(
        path=path,
        robot=robot,
        dt=dt,
        # An aborted run has no planned duration.
        duration=float(record.metadata.get(_DURATION, (last + 1) * dt)),
        settings=settings,
        pushes=[_PUSH.decode(content) for content in pushed],
        messages=messages,
    )


def write_recording(
    path: Path,
    samples: Iterable[tuple[int, OperatorSample]],
    *,
    robot: str,
    dt: float,
    settings: dict[str, Any] | None = None,
    pushes: Sequence[RecordedPush] = (),
    duration: float | None = None,
) -> None:
    """Write a log of samples and pushes alone."""
    try:
        text = json.dumps({**(settings or {}), "dt": dt}, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"the set-up of a recording is no JSON: {error}") from None
    record = RunRecord({"robot": robot, _SETUP: text})
    if duration is not None:
        record.metadata[_DURATION] = repr(duration)
    for tick, sample in samples:
        record.message(tick * dt, SAMPLES, _ENCODE(RecordedSample(tick, sample)))
    for push in pushes:
        record.message(push.tick * dt, PUSHES, _ENCODE(push))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_log(record, path)


def _last_tick(
    what: str, messages: Sequence[bytes], decode: Callable[[bytes], RecordedSample | RecordedPush]
) -> int:
    """The last tick of some messages, -1 for none."""
    last = -1
    for number, content in enumerate(messages):
        try:
            tick = decode(content).tick
        except (msgspec.DecodeError, TypeError, ValueError, OverflowError) as error:
            raise RecordingError(f"number {number} of the {what} cannot be read: {error}") from None
        if not max(last, 0) <= tick < 10**15:
            fault = f"number {number} of the {what} cannot be: its tick goes backwards"
            raise RecordingError(fault, got=tick)
        last = tick
    return last


def plant_from_json(data: dict[str, Any]) -> PlantConfig:
    """The plant of which a record has the fields."""
    return read(PlantConfig, data, "the plant of the recording", error=RecordingError)


def com_height(teleoperator: StepTeleoperator) -> float:
    """Height of the CoM over the soles at the start [m]."""
    estimator = teleoperator.estimator
    return float(estimator.dynamics.com[2] - np.mean([sole[2] for sole in estimator.anchors]))


def recorded_robot(name: str, what: str, *, option: str = "") -> Robot:
    """The robot of a record, from the catalog alone: a stranger's record opens no file."""
    try:
        known = find_entry(name) is not None
    except RobotError:
        known = False
    if not known:
        by_option = f", or {option} on the command line" if option else ""
        raise UnknownNameError(
            f"{what} was made with a robot that is not in the catalog",
            got=name,
            wanted=f'its file, by robot=load_robot("FILE"){by_option}',
        )
    return load_robot(name)


def robot_digest(robot: Robot) -> str:
    """The first letters of a digest of joints, masses, limits, soles and home of a robot."""
    model = robot.model
    numbers = [model.armature, robot.q_home, robot.q_min, robot.q_max, robot.v_max, robot.tau_max]
    numbers += [inertia.toDynamicParameters() for inertia in model.inertias]
    for placement in model.jointPlacements:
        numbers += [placement.translation, placement.rotation.ravel()]
    numbers += [[sole.length, sole.width] for sole in robot.soles.values()]
    # Six digits: another machine may read the last ones otherwise. Zeros have no sign.
    text = " ".join(f"{float(x) + 0.0:.6g}" for row in numbers for x in row)
    names = " ".join((*model.names, *robot.soles, *robot.hands))
    return hashlib.sha256(f"{names} {text}".encode()).hexdigest()[:16]
