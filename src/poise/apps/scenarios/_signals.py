"""`collect_signals`: the record of a run as arrays with one row a tick, from which it is judged."""

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.apps.report import BaseErrors, Event, RunSignals, SoleTrack, SupportPhase, TaskTrack
from poise.apps.teleoperation import plant_from_json
from poise.control import PHYSICS_LEVELS
from poise.locomotion import signed_margin, soles_outline
from poise.robots import Robot
from poise.sim import Block, PlantConfig, RunRecord


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
    time: Float64[np.ndarray, " T"], zmp: Float64[np.ndarray, "T 2"], phases: Sequence[SupportPhase]
) -> Float64[np.ndarray, " T"]:
    """Distance of the ZMP from the nearest edge of its phase's polygon, negative outside [m]."""
    margins = np.full(len(time), np.nan)
    for phase in phases:
        rows = (time >= phase.start) & (time < phase.end)
        if len(phase.vertices) >= 3 and rows.any():
            margins[rows] = signed_margin(zmp[rows], phase.vertices)
    return margins


def ground_heights(
    config: PlantConfig, points: Float64[np.ndarray, "n 2"]
) -> Float64[np.ndarray, " n"]:
    """Height of the floor in the world, or of a block's top that is above it, under points."""
    floor = pin.SE3(pin.exp3(np.array([*config.floor_slope, 0.0])), np.zeros(3))
    heights = _plane_heights(floor, points)
    for block in config.blocks:
        length, width, height = block.size
        top = block.pose * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5 * height]))
        own = _plane_heights(top, points)
        local = (np.column_stack([points, own]) - top.translation) @ top.rotation
        over = (np.abs(local[:, :2]) <= 0.5 * np.array([length, width])).all(axis=1)
        heights = np.where(over, np.maximum(heights, own), heights)
    return heights


def _plane_heights(plane: pin.SE3, points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
    normal = plane.rotation[:, 2]
    return plane.translation[2] - (points - plane.translation[:2]) @ normal[:2] / normal[2]


class BaseKnowledge:
    """Estimated and true base over a run; equal where the record has no estimate."""

    def __init__(self, record: RunRecord) -> None:
        self._estimated = "base_estimate" in record
        if self._estimated:
            self._map, self._world = record["base_estimate"], record["base_truth"]
            self._speeds = record["velocity_estimate"], record["velocity_truth"]
            # SciPy takes long to import, and a mere import of the package needs none of it.
            from scipy.spatial.transform import Rotation

            world, known = (Rotation.from_quat(p[:, 3:]) for p in (self._world, self._map))
            self._world_R_map = world * known.inv()

    @property
    def errors(self) -> BaseErrors | None:
        """Errors of the estimate; None where there is none."""
        if not self._estimated:
            return None
        estimated, true = self._speeds
        upright = self._world_R_map.apply(np.array([0.0, 0.0, 1.0]))
        return BaseErrors(
            drift=np.linalg.norm((self._map - self._world)[:, :2], axis=1),
            tilt=np.arctan2(np.linalg.norm(upright[:, :2], axis=1), upright[:, 2]),
            speed=np.linalg.norm((estimated - true)[:, :3], axis=1),
        )

    def in_world(self, points: Float64[np.ndarray, "T k"]) -> Float64[np.ndarray, "T k"]:
        """Points that lie about the true base as the given ones do about the estimated base."""
        if not self._estimated:
            return points
        known = np.zeros((len(points), 3))
        known[:, : points.shape[1]] = points
        turned = self._world_R_map.apply(known - self._map[:, :3]) + self._world[:, :3]
        return turned[:, : points.shape[1]]


_TICK, _TARGET = "tick_us/", "target/"
"""Beginnings of the names of signals: times of a tick's phases, and targets."""


def collect_signals(record: RunRecord, robot: Robot) -> RunSignals:
    """Make arrays with one row a tick from the record of a run."""
    about = record.metadata
    level_names = tuple(json.loads(about["levels"]))
    plant = plant_from_json(json.loads(about["plant"]))
    time, q = record.times("q"), record["q"]

    def aligned(name: str, *shape: int) -> Float64[np.ndarray, "T ..."]:
        """A signal on every tick, NaN where it was not recorded."""
        values = np.full((len(time), *shape), np.nan)
        if name in record:
            values[np.searchsorted(time, record.times(name))] = record[name]
        return values

    def named(beginning: str) -> dict[str, str]:
        return {n: n.removeprefix(beginning) for n in record.names if n.startswith(beginning)}

    base = BaseKnowledge(record)
    poses = {name: _sole_poses(robot, name, q) for name in robot.soles}
    soles = {
        name: SoleTrack(
            position=at,
            height=at[:, 2] - ground_heights(plant, at[:, :2]),
            wrench=record[f"wrench/{name}"],
            planned=np.nan_to_num(aligned(f"planned/{name}")),
        )
        for name, (at, _) in poses.items()
    }
    # A foot that touches down early carries load, of a newton, before the controller counts on it.
    standing = {n: np.maximum(sole.planned, sole.force > 1.0) for n, sole in soles.items()}
    support = support_phases(robot, time, standing, poses)
    tasks = tuple(
        TaskTrack(
            name=name, level=PHYSICS_LEVELS + level, unit=unit, error=aligned(f"error/{name}")
        )
        for name, level, unit in json.loads(about["tasks"])
    )
    return RunSignals(
        robot=robot.name,
        controller=about.get("controller", "")
        + (f" ({about['strategy']})" if "strategy" in about else ""),
        scenario=about.get("scenario", "a run"),
        description=about.get("description", ""),
        seed=int(about.get("seed", 0)),
        time=time,
        joint_names=robot.joint_names,
        torque=record["torque"],
        torque_max=robot.tau_max,
        position_min=robot.q_min,
        position_max=robot.q_max,
        q=q,
        tasks=tasks,
        com=record["com"],
        com_reference=base.in_world(aligned("com_reference", 3)),
        zmp=record["zmp"],
        zmp_reference=base.in_world(aligned("zmp_reference", 2)),
        zmp_margin=zmp_margins(time, record["zmp"], support),
        support=support,
        soles=soles,
        targets={name: base.in_world(aligned(n, 3)) for n, name in named(_TARGET).items()},
        residuals=aligned("residuals", len(level_names)),
        level_names=level_names,
        status=_statuses(record, time),
        tick_us={name: aligned(n) for n, name in named(_TICK).items()},
        tick_budget_us=1e6 * plant.control_dt,
        base_errors=base.errors,
        payload=_payload(record),
        clearance=aligned("clearance"),
        self_contact=aligned("self_contact"),
        beyond=_beyond(robot, soles, plant.blocks, len(time)),
        modes=record.notes("mode"),
        events=_events(record, float(time[-1])),
    )


def _payload(record: RunRecord) -> Float64[np.ndarray, "T 4"] | None:
    """Mass [kg] and offset [m] of the payload with what hands hold, where they are estimated."""
    if "payload_estimate" not in record:
        return None
    payload = record["payload_estimate"].copy()
    if "held_estimate" in record:
        payload[:, 0] += record["held_estimate"].sum(axis=1)
    return payload


def _events(record: RunRecord, end: float) -> tuple[Event, ...]:
    known = json.loads(record.metadata.get("events", "[]"))
    # The first mode is where the run begins, no event.
    known += [(time, mode, 0.0) for time, mode in record.notes("mode")[1:]]
    events = [Event(time=time, label=label, duration=seconds) for time, label, seconds in known]
    return tuple(sorted((e for e in events if e.time <= end), key=lambda e: e.time))


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
    soles: Mapping[str, SoleTrack],
    blocks: Sequence[Block],
    ticks: int,
) -> Float64[np.ndarray, " T"]:
    """Distance of the hindmost heel ahead of the last block; soles and blocks lie along x."""
    if not blocks or not soles:
        return np.full(ticks, np.nan)
    end = max(block.center[0] + 0.5 * block.size[0] for block in blocks)
    heels = [soles[name].position[:, 0] - 0.5 * sole.length for name, sole in robot.soles.items()]
    return np.min(heels, axis=0) - end


def _statuses(record: RunRecord, time: Float64[np.ndarray, " T"]) -> tuple[str, ...]:
    changes = record.notes("status")
    if not changes:
        return ("none",) * len(time)
    starts = np.array([t for t, _ in changes])
    index = np.searchsorted(starts, time, side="right") - 1
    return tuple(changes[max(int(i), 0)][1] for i in index)
