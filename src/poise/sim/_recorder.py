"""`Recorder`: the observer that makes the record of a run, in memory and in a log for Foxglove."""

import json
import math
import time as clock
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from poise._schema import Count, Duration, Seconds, checked
from poise.control import Command
from poise.dynamics import RobotState
from poise.sim._blocks import BlockWatch
from poise.sim._foxglove import Scene
from poise.sim._log import McapLog
from poise.sim._plant import Plant
from poise.sim._record import Counts, RunRecord, Value
from poise.sim._rollout import AnyController, LeadFunction, Tick
from poise.stack import ComTask, FrameTask, Leader, Stack, Task

_PHYSICS = ("dynamics, torques", "contacts, joints")
"""The levels of every controller of a stack above those of the stack."""


@checked()
@dataclass(frozen=True, kw_only=True)
class RecorderConfig:
    """How much is recorded, how much is shown, and how soon it is on the disk.

    Attributes:
        record_dt: time from one recorded tick to the next, 0 for every tick [s].
        log_dt: time from one sample of the log's topics to the next, 0 for every one [s]. It says
            what Foxglove draws; the record in the log has every sample.
        scene_dt: time from one logged set of body transforms to the next, 0 for none [s].
        flush_dt: wall-clock time after which a sample is in the file at the latest [s].
        capacity: messages that may wait for the writer.
        on_full: what happens when that many wait: "block" the run, or "drop" and count.
        keep: whether what is in the log stays in memory too; if not, a run may last for hours.
    """

    record_dt: Seconds = 0.0
    log_dt: Seconds = 0.005
    scene_dt: Seconds = 1.0 / 30.0
    flush_dt: Duration = 0.25
    capacity: Count = 4096
    on_full: Literal["block", "drop"] = "block"
    keep: bool = True


@runtime_checkable
class SolvesStack(Protocol):
    """A controller of whose stack there is something to record."""

    @property
    def stack(self) -> Stack:
        """What it solves."""
        ...

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that did not act at the last tick."""
        ...

    @property
    def timings(self) -> Mapping[str, float]:
        """How long the parts of the last tick took [s]."""
        ...


@runtime_checkable
class HasSignals(Protocol):
    """A leader with something to tell a recorder."""

    def signals(self) -> Mapping[str, Value | str]:
        """After a tick: samples of signals by name, and notes by topic."""
        ...


class Recorder:
    """Records a rollout; give it as one of the observers.

    What belongs to the end of a tick's period is recorded with the time of that end: the true `q`
    and `v`, `torque` as applied, `com`, `zmp`, a `wrench/<sole>` each, and where there are blocks
    on the floor `clearance` and `touched`; `command_torque` or `command_velocity` and `residuals`;
    of a controller with a stack `error/<task>`, `target/<task>` of each point, `com_reference` and
    `planned/<sole>`; how long leader and controller took, `tick_us/<phase>`; what the leader's
    `signals` say; and notes about the `status` of the commands.

    The log, if there is one, holds that record to the last bit, see `read_log`. Beside it a topic
    a signal (`/com`, `/zmp`, ...), one a topic of notes, `/joints`, `/tf` and `/scene` are for
    Foxglove; NaN and infinity, which JSON does not know, are null there.

    Args:
        path: the MCAP file, None for memory alone.
        config: rates and buffers.
        metadata: texts kept with the record: scenario, controller, seed.

    Attributes:
        record: of the run that is observed, or was last.
    """

    def __init__(
        self,
        path: Path | None = None,
        *,
        config: RecorderConfig | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self._path, self._config = path, config if config is not None else RecorderConfig()
        self._metadata = dict(metadata or {})
        self.record = RunRecord(self._metadata)
        self._log: McapLog | None = None

    @property
    def dropped(self) -> int:
        """Messages that the log did not take because its writer was behind."""
        return 0 if self._log is None else self._log.dropped

    # The observer --------------------------------------------------------------------------------

    def begin(
        self,
        plant: Plant,
        controller: AnyController | None = None,
        leader: Leader | LeadFunction | None = None,
    ) -> None:
        """A run begins: a new record, and the log is made.

        Args:
            plant: the plant.
            controller: what commands it; None where nothing shall be recorded of it.
            leader: what leads its stack; None where nothing shall be recorded of it.

        Raises:
            MissingExtraError: a log was asked for and the package mcap is not installed.
            PoiseError: the log cannot be made.
        """
        self._plant = plant
        self._stack = controller if isinstance(controller, SolvesStack) else None
        self._leader = leader if isinstance(leader, HasSignals) else None
        self._watch = BlockWatch(plant) if plant.config.blocks else None
        tasks = () if self._stack is None else self._stack.stack.tasks()
        self._units = {f"error/{task.name}": task.unit for _, task in tasks}
        self._joints = JointNames(plant.robot.joint_names, plant.robot.nj, plant.robot.base_dofs)
        self.record = RunRecord(self._describe() | self._metadata)
        self._written: Counts = {}
        self._next_tick, self._next_log, self._next_scene = -math.inf, -math.inf, -math.inf
        self._next_flush = clock.monotonic() + self._config.flush_dt
        if self._path is not None:
            self._log = McapLog(
                self._path,
                metadata=self.record.metadata,
                flush_dt=self._config.flush_dt,
                capacity=self._config.capacity,
                on_full=self._config.on_full,
            )
            self._scene = Scene(plant.robot, plant.model)

    def observe(self, tick: Tick) -> None:
        """Records a tick, if one is due."""
        status = tick.command.status.value
        self.note("status", status)
        told = {} if self._leader is None else self._leader.signals()
        for topic, text in told.items():
            if isinstance(text, str):
                self.note(topic, text)
        if not self._due(self._plant.time, self._next_tick):
            return
        self._next_tick = self._plant.time + self._config.record_dt
        samples = self._plant_samples(tick.truth) | self._command_samples(tick.command)
        samples |= self._stack_samples(tick)
        samples |= {name: value for name, value in told.items() if not isinstance(value, str)}
        self.sample(self._plant.time, **samples)

    def end(self) -> None:
        """The run is over: finishes the log.

        Raises:
            PoiseError: the log could not be written.
        """
        if self._log is not None:
            log, self._log = self._log, None
            log.close(self.record.block(self._written), self.record.end)

    # By hand -------------------------------------------------------------------------------------

    def look(self) -> None:
        """Records the plant as it is now, outside of a rollout."""
        self.sample(self._plant.time, **self._plant_samples(self._plant.true_state()))

    def sample(self, time: float, **values: Value) -> None:
        """Records values of one instant, whatever they are.

        Args:
            time: the instant [s].
            values: the signals by name.

        Raises:
            TargetError: a signal changed its shape.
        """
        for name, value in values.items():
            self.record.add(time, name, value, self._units.get(name))
        if self._log is not None:
            self._write(self._log, time, values)

    def note(self, topic: str, text: str) -> None:
        """Notes a text of the plant's present time, where it differs from the last of its topic.

        Args:
            topic: such as `mode`; the log has it under that name.
            text: the text.
        """
        time = self._plant.time
        if self.record.note(time, topic, text) and self._log is not None:
            stamp = round(time * 1e9)
            self._log.put((f"/{topic}", "poise.Signal", stamp, {"time": time, "value": text}))

    # What is recorded ----------------------------------------------------------------------------

    def _describe(self) -> dict[str, str]:
        """Texts from which a report can be made of the record alone."""
        plant = self._plant
        stack = None if self._stack is None else self._stack.stack
        tasks = [] if stack is None else [(t.name, n, t.unit) for n, t in stack.tasks()]
        levels = [] if stack is None else [[t.name for t in level] for level in stack.levels]
        return {
            "robot": plant.robot.name,
            "plant": json.dumps(asdict(plant.config)),
            "tasks": json.dumps(tasks),
            "levels": json.dumps([*_PHYSICS, *map(", ".join, levels)] if levels else []),
        }

    def _plant_samples(self, truth: RobotState) -> dict[str, Value]:
        plant = self._plant
        samples: dict[str, Value] = {
            "q": truth.q,
            "v": truth.v,
            "torque": plant.applied_torque,
            "com": plant.com,
            "zmp": plant.zmp(),
        }
        samples |= {f"wrench/{name}": wrench for name, wrench in truth.contacts.items()}
        if self._watch is not None:
            samples["clearance"] = self._watch.clearance()
            samples["touched"] = self._watch.touched()
        return samples

    def _command_samples(self, command: Command) -> dict[str, Value]:
        found: dict[str, Value] = {}
        if command.torque is not None:
            found["command_torque"] = command.torque
        if command.velocity is not None:
            found["command_velocity"] = command.velocity
        if command.residuals:
            found["residuals"] = np.array(command.residuals, dtype=np.float64)
        elif "residuals" in self.record:
            # A fallback command solved nothing: say so, in the shape of the others.
            found["residuals"] = np.full(self.record.shape("residuals"), np.nan)
        return found

    def _stack_samples(self, tick: Tick) -> dict[str, Value]:
        solver, found = self._stack, dict[str, Value]()
        if tick.estimator_seconds > 0.0:
            found["tick_us/estimator"] = 1e6 * tick.estimator_seconds
        if self._leader is not None:
            found["tick_us/leader"] = 1e6 * tick.leader_seconds
        if solver is None:
            found["tick_us/controller"] = 1e6 * tick.controller_seconds
            return found
        stack, suspended = solver.stack, solver.suspended
        for _, task in stack.tasks():
            acts = task not in suspended
            found[f"error/{task.name}"] = float(np.linalg.norm(task.error)) if acts else np.nan
            if isinstance(task, ComTask) and task.target_position is not None:
                found["com_reference"] = task.masked_target()
            if isinstance(task, FrameTask) and task.unit != "rad":
                point = task.target_position
                if point is not None:
                    found[f"target/{task.name}"] = point if acts else np.full(3, np.nan)
        for contact in stack.contacts:
            found[f"planned/{contact.frame}"] = float(contact.active)
        answered = tick.command.status.ok
        for phase, seconds in solver.timings.items():
            found[f"tick_us/{phase}"] = 1e6 * seconds if answered else np.nan
        return found

    # What is written -----------------------------------------------------------------------------

    @staticmethod
    def _due(time: float, planned: float) -> bool:
        # Half a nanosecond of slack keeps a rate that the control period divides exact.
        return time >= planned - 5e-10

    def _write(self, log: McapLog, time: float, values: Mapping[str, Value]) -> None:
        stamp = round(time * 1e9)
        if self._due(time, self._next_log):
            self._next_log = time + self._config.log_dt
            kept = {n: np.array(v, dtype=np.float64) for n, v in values.items()}
            if {"q", "v", "torque"} <= kept.keys():
                log.put(("/joints", "poise.Joints", stamp, self._joints.message(time, kept)))
            for name, value in kept.items():
                log.put((f"/{name}", "poise.Signal", stamp, _later(time, value)))
        if "q" in values and self._config.scene_dt > 0 and self._due(time, self._next_scene):
            self._write_scene(log, time, stamp, np.array(values["q"]))
        if clock.monotonic() >= self._next_flush:
            self._next_flush = clock.monotonic() + self._config.flush_dt
            self._write_block(log, time)

    def _write_scene(self, log: McapLog, time: float, stamp: int, q: np.ndarray) -> None:
        scene = self._scene
        if self._next_scene == -math.inf:
            log.put(("/scene", "foxglove.SceneUpdate", stamp, lambda: scene.boxes(time)))
        self._next_scene = time + self._config.scene_dt
        log.put(("/tf", "foxglove.FrameTransforms", stamp, lambda: scene.transforms(time, q)))

    def _write_block(self, log: McapLog, time: float) -> None:
        if not log.put_block(time, self.record.block(self._written)):
            return
        if not self._config.keep:
            self.record.forget()
        self._written = self.record.counts()


@dataclass(frozen=True)
class JointNames:
    """What makes messages for Foxglove's panel of joints.

    Attributes:
        names: of the joints.
        joints: how many.
        base_dofs: velocities before those of the joints.
    """

    names: tuple[str, ...]
    joints: int
    base_dofs: int

    def message(self, time: float, kept: Mapping[str, np.ndarray]) -> Any:
        """A message that the writer's thread makes of samples of q, v and torque."""
        q, v = kept["q"][-self.joints :], kept["v"][self.base_dofs :]
        return lambda: {
            "time": time,
            "name": self.names,
            "position": _plain(q),
            "velocity": _plain(v),
            "torque": _plain(kept["torque"]),
        }


def _later(time: float, value: np.ndarray) -> Any:
    """A message whose numbers are turned into text by the writer's thread."""
    return lambda: {"time": time, "value": _plain(value)}


def _plain(value: np.ndarray) -> Any:
    """Numbers as JSON knows them, None for those it does not know."""
    finite = np.isfinite(value)
    if finite.all():
        return value.tolist()
    numbers = value.astype(np.object_)
    numbers[~finite] = None
    return numbers.tolist()
