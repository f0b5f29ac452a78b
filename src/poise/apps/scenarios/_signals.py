"""`RunSignals`: the record of a run as arrays with one row a tick, from which it is judged.

Support polygons: where the soles that carry load stand, and how far inside the ZMP is.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.apps.report import BaseErrors, SupportPhase
from poise.apps.scenarios._estimate import BaseKnowledge
from poise.apps.scenarios._ground_height import ground_heights
from poise.apps.teleoperation import plant_from_json
from poise.locomotion import signed_margin, soles_outline
from poise.robots import Robot
from poise.sim import Block, RunRecord


class TaskEntry(NamedTuple):
    """A task of a recorded run.

    Attributes:
        name: of the task.
        level: of the stack, from zero.
        unit: of its error.
    """

    name: str
    level: int
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class RunSignals:
    """Recorded signals of one run, T ticks: a record with a value of everything at each tick.

    Attributes:
        tasks: of the stack.
        level_names: names of the levels of the residuals.
        time: time of each tick [s].
        q: true configuration [m, rad].
        torque: torque as applied [N m].
        torque_max: torque limits [N m].
        com: true centre of mass [m].
        com_reference: where it should be, NaN where nothing asks [m]. This and what else the
            robot was to do in the world is taken to where it sees it, by what its estimate is off.
        zmp: zero moment point [m].
        zmp_reference: where it should be, NaN where nothing asks [m].
        zmp_margin: distance of the ZMP from the edge of the support polygon, negative outside [m].
        support: support polygons over time.
        sole_forces: normal force of each sole [N].
        sole_positions: each sole's centre [m].
        sole_heights: of each sole's centre above the floor or the block under it [m].
        sole_planned: whether the controller counted on the sole, 0 or 1.
        wrenches: measured wrench of each sole, in the sole's frame [N, N m].
        targets: where each point that a task moves should be, NaN where nothing asks [m].
        task_errors: norm of each task's error, NaN while it did not act [unit].
        residuals: relative residual of each level.
        status: status of each tick.
        tick_us: time of each tick by phase [us].
        base_errors: how far off what the robot knows of its base is; None where it is told.
        clearance: distance of the robot from the nearest block, NaN without blocks [m].
        self_contact: how hard links of the robot press on each other, NaN where they cannot [N].
        beyond: how far the hindmost heel is ahead of the last block, NaN without blocks [m].
        modes: when a robot that is walked by hand changed its mode [s], or a walk its status, and
            to which.
    """

    tasks: tuple[TaskEntry, ...]
    level_names: tuple[str, ...]
    time: Float64[np.ndarray, " T"]
    q: Float64[np.ndarray, "T nq"] = field(repr=False)
    torque: Float64[np.ndarray, "T nj"] = field(repr=False)
    torque_max: Float64[np.ndarray, " nj"] = field(repr=False)
    com: Float64[np.ndarray, "T 3"] = field(repr=False)
    com_reference: Float64[np.ndarray, "T 3"] = field(repr=False)
    zmp: Float64[np.ndarray, "T 2"] = field(repr=False)
    zmp_reference: Float64[np.ndarray, "T 2"] = field(repr=False)
    zmp_margin: Float64[np.ndarray, " T"] = field(repr=False)
    support: tuple[SupportPhase, ...] = field(repr=False)
    sole_forces: dict[str, Float64[np.ndarray, " T"]] = field(repr=False)
    sole_positions: dict[str, Float64[np.ndarray, "T 3"]] = field(repr=False)
    sole_heights: dict[str, Float64[np.ndarray, " T"]] = field(repr=False)
    sole_planned: dict[str, Float64[np.ndarray, " T"]] = field(repr=False)
    wrenches: dict[str, Float64[np.ndarray, "T 6"]] = field(repr=False)
    targets: dict[str, Float64[np.ndarray, "T 3"]] = field(repr=False)
    task_errors: dict[str, Float64[np.ndarray, " T"]] = field(repr=False)
    residuals: Float64[np.ndarray, "T nl"] = field(repr=False)
    status: tuple[str, ...] = field(repr=False)
    tick_us: dict[str, Float64[np.ndarray, " T"]] = field(repr=False)
    base_errors: BaseErrors | None = field(repr=False)
    clearance: Float64[np.ndarray, " T"] = field(repr=False)
    self_contact: Float64[np.ndarray, " T"] = field(repr=False)
    beyond: Float64[np.ndarray, " T"] = field(repr=False)
    modes: tuple[tuple[float, str], ...] = field(repr=False)


def support_phases(
    robot: Robot,
    time: Float64[np.ndarray, " T"],
    planned: Mapping[str, Float64[np.ndarray, " T"]],
    poses: Mapping[str, tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, "T 3 3"]]],
) -> tuple[SupportPhase, ...]:
    """One polygon for each interval with the same soles on the ground."""
    if not planned:
        return ()
    names = list(planned)
    pattern = np.stack([planned[name] > 0.5 for name in names], axis=1)
    changes = 1 + np.flatnonzero((pattern[1:] != pattern[:-1]).any(axis=1))
    starts: Sequence[int] = [0, *changes.tolist(), len(time)]
    phases: list[SupportPhase] = []
    for a, b in pairwise(starts):
        standing = [name for name, on in zip(names, pattern[a], strict=True) if on]
        middle = (a + b) // 2
        placements = {n: (poses[n][0][middle], poses[n][1][middle]) for n in standing}
        phases.append(
            SupportPhase(
                start=float(time[a]),
                end=float(time[b]) if b < len(time) else float(time[-1]) + 1e-9,
                vertices=soles_outline(robot, placements),
                label=" + ".join(standing) or "flight",
            )
        )
    return tuple(phases)


def zmp_margins(
    time: Float64[np.ndarray, " T"],
    zmp: Float64[np.ndarray, "T 2"],
    phases: Sequence[SupportPhase],
) -> Float64[np.ndarray, " T"]:
    """Distance of the ZMP from the nearest edge of its phase's polygon, negative outside [m]."""
    margins = np.full(len(time), np.nan)
    for phase in phases:
        rows = (time >= phase.start) & (time < phase.end)
        if len(phase.vertices) < 3 or not rows.any():
            continue
        margins[rows] = signed_margin(zmp[rows], phase.vertices)
    return margins


_TICK = "tick_us/"
"""Signals of this name are times of a tick's phases."""

TOUCHING = 1.0
"""A sole that carries more than this counts as standing [N]."""


def collect_signals(record: RunRecord, robot: Robot) -> RunSignals:
    """Arrays with one row a tick, from the record of a run."""
    tasks = tuple(TaskEntry(*entry) for entry in json.loads(record.metadata["tasks"]))
    level_names = tuple(json.loads(record.metadata["levels"]))
    plant = plant_from_json(json.loads(record.metadata["plant"]))
    time, q = record.times("q"), record["q"]
    poses = {name: _sole_poses(robot, name, q) for name in robot.soles}
    planned = {
        name: record[f"planned/{name}"] if f"planned/{name}" in record else np.zeros(len(time))
        for name in robot.soles
    }
    wrenches = {name: record[f"wrench/{name}"] for name in robot.soles}
    # A foot that touches down early carries load before the controller counts on it.
    standing = {
        name: np.maximum(planned[name], wrenches[name][:, 2] > TOUCHING) for name in robot.soles
    }
    support = support_phases(robot, time, standing, poses)
    zmp = record["zmp"]
    soles = {name: position for name, (position, _) in poses.items()}
    base = BaseKnowledge(record, len(time))
    timed = [name for name in record.names if name.startswith(_TICK)]
    return RunSignals(
        tasks=tasks,
        level_names=level_names,
        time=time,
        q=q,
        torque=record["torque"],
        torque_max=robot.tau_max,
        com=record["com"],
        com_reference=base.in_world(_aligned(record, "com_reference", time, (3,))),
        zmp=zmp,
        zmp_reference=base.in_world(_aligned(record, "zmp_reference", time, (2,))),
        zmp_margin=zmp_margins(time, zmp, support),
        support=support,
        sole_forces={name: wrench[:, 2].copy() for name, wrench in wrenches.items()},
        sole_positions=soles,
        sole_heights={n: p[:, 2] - ground_heights(plant, p[:, :2]) for n, p in soles.items()},
        sole_planned=planned,
        wrenches=wrenches,
        targets={
            name.removeprefix("target/"): base.in_world(_aligned(record, name, time, (3,)))
            for name in record.names
            if name.startswith("target/")
        },
        task_errors={task.name: _aligned(record, f"error/{task.name}", time, ()) for task in tasks},
        residuals=_aligned(record, "residuals", time, (len(level_names),)),
        status=_statuses(record, time),
        tick_us={n.removeprefix(_TICK): _aligned(record, n, time, ()) for n in timed},
        base_errors=base.errors,
        clearance=_aligned(record, "clearance", time, ()),
        self_contact=_aligned(record, "self_contact", time, ()),
        beyond=_beyond(robot, soles, plant.blocks, len(time)),
        modes=record.notes("mode"),
    )


def _aligned(
    record: RunRecord, name: str, time: Float64[np.ndarray, " T"], shape: tuple[int, ...]
) -> Float64[np.ndarray, "T ..."]:
    """A signal on every tick, NaN where it was not recorded."""
    values = np.full((len(time), *shape), np.nan)
    if name in record:
        values[np.searchsorted(time, record.times(name))] = record[name]
    return values


def _sole_poses(
    robot: Robot, sole: str, q: Float64[np.ndarray, "T nq"]
) -> tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, "T 3 3"]]:
    model, frame = robot.model, robot.frame_id(sole)
    data = model.createData()
    positions, rotations = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for i, qi in enumerate(q):
        pin.framesForwardKinematics(model, data, qi)
        placement = data.oMf[frame]
        positions[i], rotations[i] = placement.translation, placement.rotation
    return positions, rotations


def _beyond(
    robot: Robot,
    soles: Mapping[str, Float64[np.ndarray, "T 3"]],
    blocks: Sequence[Block],
    ticks: int,
) -> Float64[np.ndarray, " T"]:
    """How far the hindmost heel is ahead of the last block; soles and blocks lie along x."""
    if not blocks or not soles:
        return np.full(ticks, np.nan)
    end = max(block.center[0] + 0.5 * block.size[0] for block in blocks)
    heels = [soles[name][:, 0] - 0.5 * sole.length for name, sole in robot.soles.items()]
    return np.min(heels, axis=0) - end


def _statuses(record: RunRecord, time: Float64[np.ndarray, " T"]) -> tuple[str, ...]:
    changes = record.notes("status")
    if not changes:
        return ("none",) * len(time)
    starts = np.array([t for t, _ in changes])
    index = np.searchsorted(starts, time, side="right") - 1
    return tuple(changes[max(int(i), 0)][1] for i in index)
