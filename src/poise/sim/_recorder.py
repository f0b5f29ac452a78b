"""`Recorder`: the observer that makes the record of a run, in memory and in a log for Foxglove."""

import json
import math
import time as clock
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol, SupportsBytes, runtime_checkable

import mujoco
import numpy as np

from poise._schema import Duration, Seconds, checked
from poise.control import Command
from poise.dynamics import RobotState
from poise.sim._build import FLOOR_ONLY
from poise.sim._foxglove import Pace, RobotTopics
from poise.sim._log import McapLog
from poise.sim._plant import Plant
from poise.sim._record import RunRecord, Value
from poise.sim._rollout import AnyController, LeadFunction, Tick
from poise.stack import ComTask, FrameTask, Leader, Stack, Task

# The levels of every controller of a stack above those of the stack
_PHYSICS = ("dynamics, torques", "contacts, joints")


@checked()
@dataclass(frozen=True, kw_only=True)
class RecorderConfig:
    """Rates and buffers of a recorder."""

    record_dt: Seconds = 0.0  # time from one recorded tick to the next, 0 for every tick [s]
    scene_dt: Seconds = 1.0 / 30.0  # [s]
    flush_dt: Duration = 0.25  # [s]
    keep: bool = True  # whether what is in the log stays in memory too


@runtime_checkable
class SolvesStack(Protocol):
    """A controller with a stack; tasks suspended at the last tick, seconds of its parts."""

    stack: Stack
    suspended: tuple[Task, ...]
    timings: Mapping[str, float]


@runtime_checkable
class HasSignals(Protocol):
    """A leader, or a plant, with signals to record."""

    def signals(self) -> Mapping[str, Value | str]:
        """Samples of signals by name, and notes by topic, after a tick."""
        ...


class Recorder:
    """Record a rollout; give it as one of the observers.

    With the time of the end of a tick's period are recorded: the true `q` and `v`, `torque` as
    applied, `com`, `zmp`, a `wrench/<sole>` each, with blocks on the floor `clearance` and
    `touched`, and the largest force between links, `self_contact`; `command_torque` or
    `command_velocity` and `residuals`; of a controller with a stack `error/<task>`,
    `target/<task>` of each point, `com_reference` and `planned/<sole>`; times of computation,
    `tick_us/<phase>`; the leader's `signals`; notes about the `status` of the commands and about
    links that touch. An estimator adds `base_estimate` and `base_truth` (position and quaternion),
    `velocity_estimate` and `velocity_truth` (in the base) of the begin of the period,
    `payload_estimate`: mass and offset beyond the description, and `held_estimate`: the mass in
    each hand.

    Foxglove opens the log: `/signals` has a field a signal (`/signals.com[0]`,
    `/signals.wrench_left_sole[2]`), with a number behind for those that are sampled apart; a topic
    each of notes, `/joints`, `/tf` and `/scene`.

    Args:
        path: the MCAP file, None for memory alone.
        config: rates and buffers.
        metadata: texts kept with the record: scenario, controller, seed.

    Attributes:
        record: of the run that is observed, or was last.
    """

    def __init__(
        self,
        path: str | Path | None = None,
        *,
        config: RecorderConfig | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self._path = None if path is None else Path(path)
        self._config = config if config is not None else RecorderConfig()
        self._metadata = dict(metadata or {})
        self.record = RunRecord(self._metadata)
        self._log: McapLog | None = None

    def begin(
        self,
        plant: Plant,
        controller: AnyController | None = None,
        leader: Leader | LeadFunction | None = None,
    ) -> None:
        """Begin a record, and the log.

        Args:
            plant: the plant.
            controller: commands it; None where nothing is recorded of it.
            leader: leads its stack; None where nothing is recorded of it.

        Raises:
            MissingExtraError: the package mcap, which a log needs, is not installed.
            PoiseError: the log cannot be made.
        """
        config, robot = self._config, plant.robot
        self._plant = plant
        self._stack = _WatchedStack(controller) if isinstance(controller, SolvesStack) else None
        self._leader = leader if isinstance(leader, HasSignals) else None
        self._sources = [part for part in (leader, plant) if isinstance(part, HasSignals)]
        self._truth = plant.true_state()
        self._watch = BlockWatch(plant) if plant.config.blocks else None
        self._wrenches = [(name, f"wrench/{name}") for name in robot.soles]
        self._load, self._held = np.zeros(4), np.zeros(len(robot.hands))
        about = {"robot": robot.name, "plant": json.dumps(asdict(plant.config))}
        # Sufficient for a report from the record alone.
        tasks, levels = [], []
        if isinstance(controller, SolvesStack):
            tasks = [(t.name, n, t.unit) for n, t in controller.stack.tasks()]
            levels = [", ".join(t.name for t in level) for level in controller.stack.levels]
            levels = [*_PHYSICS, *levels] if levels else []
        about |= {"tasks": json.dumps(tasks), "levels": json.dumps(levels)}
        self._units = {} if self._stack is None else self._stack.units
        self.record = RunRecord(about | self._metadata, joints=robot.joint_names)
        self._pace = Pace(config.record_dt)
        self._has_touched = False
        self._next_flush = clock.monotonic() + config.flush_dt
        if self._path is not None:
            shown = config.scene_dt > 0.0
            topics = RobotTopics(robot, plant.model, config.scene_dt) if shown else None
            self._log = McapLog(self._path, self.record, topics, keep=config.keep)

    def observe(self, tick: Tick) -> None:
        """Record a tick, if one is due."""
        plant, note = self._plant, self.record.note
        time, due = plant.time, self._pace.is_due(plant.time)
        samples: dict[str, Value] = {}
        note(time, "status", tick.command.status.value)
        if plant.config.self_contact:
            pairs = ["{} on {}".format(*pair) for pair in sorted(plant.self_contacts)]
            if pairs or self._has_touched:
                note(time, "self_contact", ", ".join(pairs) or "none")
                self._has_touched = True
        if due:
            self._add_plant(samples, tick.truth)
            # An estimator that can make nothing of a state hands it on as it came.
            if tick.estimator_seconds > 0.0 and plant.robot.floating_base:
                self._add_estimate(samples, tick.estimate)
            self._add_command(samples, tick.command)
            if tick.estimator_seconds > 0.0:
                samples["tick_us/estimator"] = 1e6 * tick.estimator_seconds
            if self._leader is not None:
                samples["tick_us/leader"] = 1e6 * tick.leader_seconds
            if self._stack is None:
                samples["tick_us/controller"] = 1e6 * tick.controller_seconds
            else:
                self._stack.add(samples, answered=tick.command.status.ok)
        for source in self._sources:
            for name, value in source.signals().items():
                if isinstance(value, str):
                    note(time, name, value)
                elif due:
                    samples[name] = value
        self._truth = tick.truth
        if due:
            self._keep(time, samples)

    def end(self) -> None:
        """Finish the log.

        Raises:
            PoiseError: the log could not be written.
        """
        if self._log is not None:
            log, self._log = self._log, None
            log.close()

    @property
    def failure(self) -> Exception | None:
        """Error that ended the writing of the log; None for none."""
        return None if self._log is None else self._log.failure

    def flush(self) -> None:
        """Hand everything so far to the writer of the log, as happens every `flush_dt`."""
        self._next_flush = clock.monotonic() + self._config.flush_dt
        if self._log is not None:
            self._log.put()

    def look(self) -> None:
        """Record the plant as it is now, outside of a rollout."""
        samples: dict[str, Value] = {}
        self._add_plant(samples, self._plant.true_state())
        self.sample(self._plant.time, **samples)

    def sample(self, time: float, **values: Value) -> None:
        """Record values by the signal's name of one time [s]; their shapes stay as they are."""
        self._keep(time, values)

    def note(self, topic: str, text: str) -> None:
        """Note a text, such as a `mode`, where it differs from the last of its topic."""
        self.record.note(self._plant.time, topic, text)

    def message(self, topic: str, content: SupportsBytes) -> None:
        """Record a message now: bytes, or an immutable value encoded later."""
        self.record.message(self._plant.time, topic, content)

    def _keep(self, time: float, samples: Mapping[str, Value]) -> None:
        self.record.add(time, samples, self._units)
        if clock.monotonic() >= self._next_flush:
            self.flush()

    def _add_plant(self, samples: dict[str, Value], truth: RobotState) -> None:
        plant = self._plant
        samples["q"], samples["v"], samples["torque"] = truth.q, truth.v, plant.applied_torque
        samples["com"], samples["zmp"] = plant.com, plant.zmp()
        for sole, name in self._wrenches:
            samples[name] = truth.contacts[sole]
        if self._watch is not None:
            samples["clearance"] = self._watch.clearance()
            samples["touched"] = self._watch.touched()
        if plant.config.self_contact:
            samples["self_contact"] = max(plant.self_contacts.values(), default=0.0)

    def _add_estimate(self, samples: dict[str, Value], estimate: RobotState) -> None:
        # What was known when the period began, beside what was so then.
        truth, load = self._truth, estimate.payload
        samples["base_estimate"], samples["velocity_estimate"] = estimate.q[:7], estimate.v[:6]
        samples["base_truth"], samples["velocity_truth"] = truth.q[:7], truth.v[:6]
        known, held = self._load, self._held
        known[0], known[1:] = (0.0, 0.0) if load is None else (load.mass, load.offset)
        samples["payload_estimate"] = known
        if len(held):
            held[:] = load.held if load is not None and len(load.held) == len(held) else 0.0
            samples["held_estimate"] = held

    def _add_command(self, samples: dict[str, Value], command: Command) -> None:
        if command.torque is not None:
            samples["command_torque"] = command.torque
        if command.velocity is not None:
            samples["command_velocity"] = command.velocity
        if command.residuals:
            samples["residuals"] = np.array(command.residuals, dtype=np.float64)
        elif "residuals" in self.record:
            # A fallback command has no solution: NaN, in the shape of the others.
            samples["residuals"] = np.full(self.record.shape("residuals"), np.nan)


class _WatchedStack:
    """Signals of a controller's stack; its tasks and contacts are looked up once."""

    def __init__(self, solver: SolvesStack) -> None:
        self._solver = solver
        tasks = [task for _, task in solver.stack.tasks()]
        self.units = {f"error/{task.name}": task.unit for task in tasks}
        self._tasks = [*zip(self.units, tasks, strict=True)]
        self._coms = [task for task in tasks if isinstance(task, ComTask)]
        frames = [task for task in tasks if isinstance(task, FrameTask) and task.unit != "rad"]
        self._points = [(f"target/{task.name}", task) for task in frames]
        self._contacts = [(f"planned/{c.frame}", c) for c in solver.stack.contacts]

    def add(self, samples: dict[str, Value], *, answered: bool) -> None:
        """Add samples of the last tick; `answered` where the controller had an answer."""
        suspended = self._solver.suspended
        for name, task in self._tasks:
            error = task.error
            # The Euclidean norm, in a third of the time of NumPy's function.
            samples[name] = math.nan if task in suspended else math.sqrt(error.dot(error))
        for task in self._coms:
            samples["com_reference"] = task.masked_target()
        for name, task in self._points:
            point = task.target_position
            if point is not None:
                samples[name] = np.full(3, np.nan) if task in suspended else point
        for name, contact in self._contacts:
            samples[name] = float(contact.active)
        for phase, seconds in self._solver.timings.items():
            samples[f"tick_us/{phase}"] = 1e6 * seconds if answered else math.nan


class BlockWatch:
    """Touch of a plant's blocks and the distance from them."""

    def __init__(self, plant: Plant, *, distance_max: float = 0.2) -> None:
        self._plant, self._far = plant, distance_max
        model = plant.model
        blocks = [int(model.geom(f"block{i}").id) for i in range(len(plant.config.blocks))]
        solid = (model.geom_conaffinity & FLOOR_ONLY["conaffinity"]) != 0
        self._blocks, self._touching = blocks, set(blocks)
        self._limbs = np.flatnonzero(solid & (model.geom_bodyid > 0))
        self._radii = model.geom_rbound[self._limbs]
        # Blocks stay where they are.
        self._centers, self._block_radii = plant.data.geom_xpos[blocks], model.geom_rbound[blocks]
        turns = plant.data.geom_xmat[blocks].reshape(-1, 3, 3)
        up = (np.abs(turns[:, 2:]) @ model.geom_size[blocks, :, None]).ravel()
        self._top = float((self._centers[:, 2] + up).max(initial=-math.inf))

    def touched(self) -> bool:
        """True where a solid part of the robot touched a block at the last physics step."""
        return not self._touching.isdisjoint(self._plant.data.contact.geom.ravel().tolist())

    def clearance(self) -> float:
        """Distance of the robot's solid parts from the blocks, at most `distance_max` [m]."""
        model, data, nearest = self._plant.model, self._plant.data, self._far
        places = data.geom_xpos[self._limbs]
        # Most of a robot is far above all blocks, and most blocks are far from it.
        low = np.flatnonzero(places[:, 2] - self._radii < self._top + nearest)
        apart = np.linalg.norm(self._centers[:, None] - places[low], axis=2)
        least = apart - self._block_radii[:, None] - self._radii[low]
        for block, limb in np.argwhere(least < nearest).tolist():
            pair = self._blocks[block], self._limbs[low[limb]]
            nearest = min(nearest, mujoco.mj_geomDistance(model, data, *pair, nearest, None))
        return float(nearest)
