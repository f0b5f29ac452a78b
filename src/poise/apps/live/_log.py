"""`Takes`: every live run on the disk, from reset to reset, while it goes on.

`LiveLog`: the signals of a live run, in a log that Foxglove opens.
"""

import math
import re
import threading
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.control import Command
from poise.errors import PoiseError
from poise.locomotion import (
    DeviceSample,
    RecordingWriter,
    RowKind,
    StepTeleoperator,
    read_recording,
)
from poise.sim import McapLog, Plant, Scene

LOG_SUFFIX = ".mcap"

_PERIOD, _SCENE_PERIOD = 0.05, 0.1
"""Robot time from one sample, and from one picture of the bodies, to the next [s].

The writer's thread takes the interpreter from the robot: at 50 Hz a tick cost a fifth more."""
_FLUSH_PERIOD = 0.25
_CAPACITY = 2048
"""Messages that may wait for the writer; beyond that they are dropped, the robot never waits."""


class LiveLog:
    """Writes runs as `poise.sim.Recorder` does, but keeps nothing in memory: they may last hours.

    Topics: true `q` and `v`, `torque`, `com`, `zmp`, a `wrench/<sole>` each, `command_velocity`,
    `zmp_reference` and `soles` as the controller has them, moved into the simulator's world, the
    mode under `/mode` and the command's status under `/status` whenever they change, `/joints`,
    `/tf` and `/scene`. A thread of its own turns them into text. A log that cannot be written ends
    nothing but itself.

    Args:
        plant: whose runs.

    Attributes:
        problem: why there is no log, or not all of it; "" where there is.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._scene = Scene(plant.robot, plant.model)
        self._path: Path | None = None
        self._log: McapLog | None = None
        self.problem = ""
        self._forget()

    def begin(self, path: Path) -> None:
        """The next run begins; the file is made when somebody drives.

        Args:
            path: the file, overwritten.
        """
        self.finish()
        self._path = path
        self._forget()

    def note(
        self,
        controller: StepTeleoperator,
        command: Command,
        offset: Float64[np.ndarray, "3"],
        *,
        driven: bool,
    ) -> None:
        """Notes a tick if one is due.

        Args:
            controller: as it is after the tick.
            command: what it gave.
            offset: from the controller's world to the simulator's [m].
            driven: whether a sample came from the operator.
        """
        if self._log is None and self._path is not None and driven:
            self._open(self._path)
        log, status, time = self._log, controller.status, self._plant.time
        if log is None or status is None:
            return
        stamp = round(1e9 * time)
        self._say(log, "mode", status.mode.name, time)
        self._say(log, "status", command.status.value, time)
        # Half a nanosecond of slack keeps a rate that the tick divides exact.
        if time >= self._due - 5e-10:
            self._due = time + _PERIOD
            values = self._signals(command) | {
                "zmp_reference": status.zmp_reference + offset[:2],
                "soles": np.array(status.soles) + offset,
            }
            log.put(("/joints", "poise.Joints", stamp, self._joints(time, values)))
            for name, value in values.items():
                log.put((f"/{name}", "poise.Signal", stamp, _signal(time, value)))
        if time >= self._scene_due - 5e-10:
            self._draw(log, time)

    def finish(self) -> None:
        """Finishes the file, if there is one."""
        log, self._log, self._path = self._log, None, None
        if log is None:
            return
        try:
            log.close()
        except PoiseError as error:
            self.problem = str(error)
        else:
            if log.dropped:
                self.problem = f"{log.dropped} messages are missing in {log.path.name}"

    def _open(self, path: Path) -> None:
        # A file that cannot be made is not tried again at each tick.
        self._path = None
        try:
            self._log = McapLog(
                path,
                metadata={"robot": self._plant.robot.name, "controller": "step teleoperation"},
                flush_dt=_FLUSH_PERIOD,
                capacity=_CAPACITY,
                on_full="drop",
            )
        except PoiseError as error:
            self.problem = str(error)

    def _forget(self) -> None:
        self._due, self._scene_due = -math.inf, -math.inf
        self._said: dict[str, str] = {}

    def _signals(self, command: Command) -> dict[str, Float64[np.ndarray, "..."]]:
        plant = self._plant
        state = plant.true_state()
        values = {
            "q": state.q,
            "v": state.v,
            "torque": plant.applied_torque.copy(),
            "com": plant.com.copy(),
            "zmp": plant.zmp(),
        }
        values |= {f"wrench/{name}": wrench for name, wrench in state.contacts.items()}
        if command.velocity is not None:
            values["command_velocity"] = command.velocity
        return values

    def _joints(self, time: float, values: dict[str, Float64[np.ndarray, "..."]]) -> Any:
        robot, q, v = self._plant.robot, values["q"], values["v"]
        return lambda: {
            "time": time,
            "name": robot.joint_names,
            "position": q[-robot.nj :].tolist(),
            "velocity": v[robot.base_dofs :].tolist(),
            "torque": values["torque"].tolist(),
        }

    def _draw(self, log: McapLog, time: float) -> None:
        scene, q = self._scene, self._plant.map.q(self._plant.data.qpos)
        stamp = round(1e9 * time)
        if self._scene_due == -math.inf:
            log.put(("/scene", "foxglove.SceneUpdate", stamp, lambda: scene.boxes(time)))
        self._scene_due = time + _SCENE_PERIOD
        log.put(("/tf", "foxglove.FrameTransforms", stamp, lambda: scene.transforms(time, q)))

    def _say(self, log: McapLog, topic: str, text: str, time: float) -> None:
        if self._said.get(topic) != text:
            self._said[topic] = text
            message = {"time": time, "value": text}
            log.put((f"/{topic}", "poise.Signal", round(1e9 * time), message))


def _signal(time: float, value: Float64[np.ndarray, "..."]) -> Any:
    """A message whose numbers the writer's thread turns into text; no NaN, which JSON has not."""

    def make() -> dict[str, Any]:
        numbers = value.astype(np.object_)
        numbers[~np.isfinite(value)] = None
        return {"time": time, "value": numbers.tolist()}

    return make


SUFFIX = ".teleop"


class Takes:
    """Records into numbered files of a folder; what is there already stays.

    Args:
        folder: made when it is not there.
        robot: the robot's name.
        dt: length of a tick [s].
    """

    def __init__(self, folder: Path, *, robot: str, dt: float) -> None:
        self.folder, self._robot, self._dt = folder, robot, dt
        folder.mkdir(parents=True, exist_ok=True)
        self._writer: RecordingWriter | None = None
        # Held while files change hands; noting a sample does not wait for it.
        self._lock = threading.RLock()
        self._setup: dict[str, Any] = {}
        self._ticks = 0
        self.path = folder

    @property
    def files(self) -> list[str]:
        """Names of the recordings that are there."""
        return sorted(p.name for p in self.folder.glob(f"*{SUFFIX}"))

    def begin(self, setup: dict[str, Any]) -> None:
        """Begins the next take and finishes the one before.

        Args:
            setup: what a replay needs, see `teleop_setup`.
        """
        with self._lock:
            self.finish()
            self.path = self.folder / f"take-{self._next('take'):03}{SUFFIX}"
            self._setup, self._ticks = setup, 0
            self._writer = self._open(self.path, setup)

    def sample(self, tick: int, sample: DeviceSample | None) -> None:
        """Notes a tick, and what came before it."""
        self._ticks = tick + 1
        if self._writer is not None and sample is not None:
            self._writer.sample(tick, sample)

    def push(self, tick: int, force: Float64[np.ndarray, "3"], duration: float) -> None:
        """Notes a push on the torso [N], [s]."""
        if self._writer is not None:
            self._writer.push(tick, force, duration)

    def flush(self) -> None:
        """Whatever happens to this process, what was noted so far is on the disk."""
        if self._writer is not None:
            self._writer.flush()

    def finish(self) -> None:
        """Closes the take; one in which nothing happened leaves no file."""
        with self._lock:
            if self._writer is None:
                return
            self._writer.close()
            self._writer = None
            if len(read_recording(self.path, allow_partial=True).rows) == 0:
                self.path.unlink()
            else:
                # The header was written before anybody knew how long the take would be.
                self._copy(self.path.with_suffix(".part"), self._ticks).replace(self.path)

    def keep(self) -> Path:
        """Writes a finished copy of the take so far; another thread may go on recording.

        Returns:
            The copy.
        """
        with self._lock:
            ticks = self._ticks
            self.flush()
            return self._copy(self.folder / f"kept-{self._next('kept'):03}{SUFFIX}", ticks)

    def _copy(self, path: Path, ticks: int) -> Path:
        """The take up to a tick, with the duration that it has by then."""
        recording = read_recording(self.path, allow_partial=True)
        setup = self._setup | {"duration": ticks * self._dt}
        with self._open(path, setup) as writer:
            for row in recording.rows[recording.rows["tick"] < ticks]:
                left, right = row["left"].astype(np.float64), row["right"].astype(np.float64)
                if row["kind"] == RowKind.PUSH:
                    writer.push(int(row["tick"]), left, float(right[0]))
                else:
                    sample = DeviceSample(float(row["time"]), left, right, bool(row["upright"]))
                    writer.sample(int(row["tick"]), sample)
        return path

    def _open(self, path: Path, setup: dict[str, Any]) -> RecordingWriter:
        return RecordingWriter(path, robot=self._robot, dt=self._dt, setup=setup)

    def _next(self, kind: str) -> int:
        found = (re.fullmatch(rf"{kind}-(\d+)\{SUFFIX}", name) for name in self.files)
        return 1 + max((int(match[1]) for match in found if match), default=0)
