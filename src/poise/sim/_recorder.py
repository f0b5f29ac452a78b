"""`Recorder`: the signals of a run, in memory and in a log that Foxglove opens."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from poise._schema import Count, Duration, Seconds, checked
from poise.control import Command
from poise.errors import UnknownNameError
from poise.sim._foxglove import Scene
from poise.sim._log import McapLog, Signal
from poise.sim._plant import Plant

Value = float | Float64[np.ndarray, "..."]


@checked()
@dataclass(frozen=True, kw_only=True)
class RecorderConfig:
    """How much is logged, and how soon it is on the disk. Memory always keeps every sample.

    Attributes:
        log_dt: time from one logged sample to the next, 0 for every sample [s].
        scene_dt: time from one logged set of body transforms to the next, 0 for none [s].
        flush_dt: wall-clock time after which a sample is in the file at the latest [s].
        capacity: messages that may wait for the writer.
        on_full: what happens when that many wait: "block" the run, or "drop" and count.
    """

    log_dt: Seconds = 0.005
    scene_dt: Seconds = 1.0 / 30.0
    flush_dt: Duration = 0.25
    capacity: Count = 4096
    on_full: Literal["block", "drop"] = "block"


class Recorder:
    """Records signals of a plant's run; a context manager that finishes the log.

    In memory every sample of every signal is kept as it was given. The log, if there is one, has
    a topic a signal (`/com`, `/zmp`, ...), `/joints`, `/status`, `/tf` and `/scene`; NaN and
    infinity, which JSON does not know, are null there.

    Args:
        plant: the plant, for the names of its joints and its looks.
        path: the MCAP file, None for memory alone.
        config: rates and buffers.
        metadata: texts kept in the log: scenario, controller, seed.

    Raises:
        MissingExtraError: a log is wanted and the package mcap is not installed.
        PoiseError: the log cannot be made.
    """

    def __init__(
        self,
        plant: Plant,
        path: Path | None = None,
        *,
        config: RecorderConfig | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self._plant = plant
        self._config = config if config is not None else RecorderConfig()
        self._signals: dict[str, Signal] = {}
        self._statuses: list[tuple[float, str]] = []
        self._notes: dict[str, list[tuple[float, str]]] = {}
        self._next_log, self._next_scene = -math.inf, -math.inf
        self._log: McapLog | None = None
        if path is not None:
            self._log = McapLog(
                path,
                metadata={"robot": plant.robot.name} | dict(metadata or {}),
                flush_dt=self._config.flush_dt,
                capacity=self._config.capacity,
                on_full=self._config.on_full,
            )
            self._scene = Scene(plant.robot, plant.model)

    def record(self, command: Command | None = None, **extra: Value) -> None:
        """Record the plant as it is now, with the command that it was given.

        Signals: q, v (true), torque (as applied), com, zmp, and a `wrench/<sole>` each; and, from
        the command, `command_torque` or `command_velocity` and `residuals`.

        Args:
            command: the last command.
            extra: further signals by name, such as task errors; each keeps its first shape.

        Raises:
            TargetError: a signal changed its shape.
        """
        plant = self._plant
        state = plant.true_state()
        samples: dict[str, Value] = {
            "q": state.q,
            "v": state.v,
            "torque": plant.applied_torque,
            "com": plant.com,
            "zmp": plant.zmp(),
        }
        samples |= {f"wrench/{name}": wrench for name, wrench in state.contacts.items()}
        samples |= self._command_samples(command)
        status = "none" if command is None else command.status.value
        self.sample(plant.time, status=status, **(samples | extra))

    def sample(self, time: float, *, status: str | None = None, **values: Value) -> None:
        """Record values of one instant, whatever they are.

        Args:
            time: the instant [s].
            status: a text, logged under `/status` when it changes.
            values: the signals by name.

        Raises:
            TargetError: a signal changed its shape.
        """
        for name, value in values.items():
            signal = self._signals.get(name)
            if signal is None:
                signal = self._signals[name] = Signal(name, np.shape(value))
            signal.append(time, value)
        known = self._statuses[-1][1] if self._statuses else None
        news = status if status != known else None
        if news is not None:
            self._statuses.append((time, news))
        if self._log is not None:
            self._write(self._log, time, news, values)

    def note(self, topic: str, text: str) -> None:
        """Notes a text of the plant's present time, where it differs from the last of its topic.

        Args:
            topic: such as `mode`; the log has it under that name.
            text: the text.
        """
        notes = self._notes.setdefault(topic, [])
        if notes and notes[-1][1] == text:
            return
        time = self._plant.time
        notes.append((time, text))
        if self._log is not None:
            stamp = round(time * 1e9)
            self._log.put((f"/{topic}", "poise.Signal", stamp, {"time": time, "value": text}))

    def notes(self, topic: str) -> tuple[tuple[float, str], ...]:
        """What was noted under a topic, with its times [s]."""
        return tuple(self._notes.get(topic, ()))

    def times(self, name: str) -> Float64[np.ndarray, " n"]:
        """Times of a signal's samples [s].

        Raises:
            UnknownNameError: no such signal.
        """
        return self._signal(name).times

    def __getitem__(self, name: str) -> Float64[np.ndarray, "n ..."]:
        """All samples of a signal, time first.

        Raises:
            UnknownNameError: no such signal.
        """
        return self._signal(name).values

    def __contains__(self, name: str) -> bool:
        return name in self._signals

    @property
    def names(self) -> tuple[str, ...]:
        """The signals recorded so far."""
        return tuple(self._signals)

    @property
    def statuses(self) -> tuple[tuple[float, str], ...]:
        """Each change of status with its time [s]."""
        return tuple(self._statuses)

    @property
    def dropped(self) -> int:
        """Messages that the log did not take because its writer was behind."""
        return 0 if self._log is None else self._log.dropped

    def close(self) -> None:
        """Finish the log.

        Raises:
            PoiseError: the log could not be written.
        """
        if self._log is not None:
            log, self._log = self._log, None
            log.close()

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _command_samples(self, command: Command | None) -> dict[str, Value]:
        if command is None:
            return {}
        found: dict[str, Value] = {}
        if command.torque is not None:
            found["command_torque"] = command.torque
        if command.velocity is not None:
            found["command_velocity"] = command.velocity
        if command.residuals:
            found["residuals"] = np.array(command.residuals, dtype=np.float64)
        elif "residuals" in self._signals:
            # A fallback command solved nothing: say so, in the shape of the others.
            found["residuals"] = np.full(self._signals["residuals"].shape, np.nan)
        return found

    def _signal(self, name: str) -> Signal:
        if name not in self._signals:
            raise UnknownNameError("unknown signal", got=name, choices=self._signals)
        return self._signals[name]

    def _write(
        self, log: McapLog, time: float, status: str | None, values: Mapping[str, Value]
    ) -> None:
        stamp = round(time * 1e9)
        if status is not None:
            log.put(("/status", "poise.Signal", stamp, {"time": time, "value": status}))
        # Half a nanosecond of slack keeps a rate that the control period divides exact.
        if time >= self._next_log - 5e-10:
            self._next_log = time + self._config.log_dt
            kept = {n: np.array(v, dtype=np.float64) for n, v in values.items()}
            self._write_samples(log, time, stamp, kept)
        if "q" in values and self._config.scene_dt > 0 and time >= self._next_scene - 5e-10:
            self._write_scene(log, time, stamp, np.array(values["q"]))

    def _write_samples(
        self, log: McapLog, time: float, stamp: int, kept: dict[str, Float64[np.ndarray, "..."]]
    ) -> None:
        robot = self._plant.robot
        if {"q", "v"} <= kept.keys():
            torque = kept.get("torque", np.zeros(0))
            q, v = kept["q"][-robot.nj :], kept["v"][robot.base_dofs :]
            log.put(
                (
                    "/joints",
                    "poise.Joints",
                    stamp,
                    lambda: {
                        "time": time,
                        "name": robot.joint_names,
                        "position": _plain(q),
                        "velocity": _plain(v),
                        "torque": _plain(torque),
                    },
                )
            )
        for name, value in kept.items():
            log.put((f"/{name}", "poise.Signal", stamp, _later(time, value)))

    def _write_scene(
        self, log: McapLog, time: float, stamp: int, q: Float64[np.ndarray, " nq"]
    ) -> None:
        scene = self._scene
        if self._next_scene == -math.inf:
            log.put(("/scene", "foxglove.SceneUpdate", stamp, lambda: scene.boxes(time)))
        self._next_scene = time + self._config.scene_dt
        log.put(("/tf", "foxglove.FrameTransforms", stamp, lambda: scene.transforms(time, q)))


def _later(time: float, value: Float64[np.ndarray, "..."]) -> Any:
    """A message whose numbers are turned into text by the writer's thread."""
    return lambda: {"time": time, "value": _plain(value)}


def _plain(value: Float64[np.ndarray, "..."]) -> Any:
    """Numbers as JSON knows them, None for those it does not know."""
    finite = np.isfinite(value)
    if finite.all():
        return value.tolist()
    numbers = value.astype(np.object_)
    numbers[~finite] = None
    return numbers.tolist()
