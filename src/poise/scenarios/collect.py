"""From the recorder's signals to `RunSignals`."""

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.control.stack import Stack
from poise.robots.robot import Robot
from poise.scenarios.signals import RunSignals
from poise.scenarios.support import support_phases, zmp_margins
from poise.sim import Block, Recorder

_TICK = "tick_us/"
"""Signals of this name are times of a tick's phases."""

TOUCHING = 1.0
"""A sole that carries more than this counts as standing [N]."""


def collect_signals(
    recorder: Recorder, robot: Robot, stack: Stack, levels: int, blocks: Sequence[Block] = ()
) -> RunSignals:
    """Arrays with one row a tick, from what was recorded.

    Args:
        recorder: of a run with at least one tick.
        robot: the robot.
        stack: the controller's stack.
        levels: how many levels its commands have residuals of.
        blocks: on the floor.

    Returns:
        The run's signals; ticks with nothing to measure hold NaN.
    """
    time, q = recorder.times("q"), recorder["q"]
    poses = {name: _sole_poses(robot, name, q) for name in robot.soles}
    planned = {
        name: recorder[f"planned/{name}"] if f"planned/{name}" in recorder else np.zeros(len(time))
        for name in robot.soles
    }
    wrenches = {name: recorder[f"wrench/{name}"] for name in robot.soles}
    # A foot that touches down early carries load before the controller counts on it.
    standing = {
        name: np.maximum(planned[name], wrenches[name][:, 2] > TOUCHING) for name in robot.soles
    }
    support = support_phases(robot, time, standing, poses)
    zmp = recorder["zmp"]
    soles = {name: position for name, (position, _) in poses.items()}
    timed = [name for name in recorder.names if name.startswith(_TICK)]
    return RunSignals(
        time=time,
        q=q,
        torque=recorder["torque"],
        torque_max=robot.tau_max,
        com=recorder["com"],
        com_reference=_aligned(recorder, "com_reference", time, (3,)),
        zmp=zmp,
        zmp_reference=_aligned(recorder, "zmp_reference", time, (2,)),
        zmp_margin=zmp_margins(time, zmp, support),
        support=support,
        sole_forces={name: wrench[:, 2].copy() for name, wrench in wrenches.items()},
        sole_positions=soles,
        sole_planned=planned,
        wrenches=wrenches,
        targets={
            name.removeprefix("target/"): _aligned(recorder, name, time, (3,))
            for name in recorder.names
            if name.startswith("target/")
        },
        task_errors={
            t.name: _aligned(recorder, f"error/{t.name}", time, ()) for _, t in stack.tasks()
        },
        residuals=_aligned(recorder, "residuals", time, (levels,)),
        status=_statuses(recorder, time),
        tick_us={n.removeprefix(_TICK): _aligned(recorder, n, time, ()) for n in timed},
        clearance=_aligned(recorder, "clearance", time, ()),
        beyond=_beyond(robot, soles, blocks, len(time)),
        modes=recorder.notes("mode"),
    )


def _aligned(
    recorder: Recorder, name: str, time: Float64[np.ndarray, " T"], shape: tuple[int, ...]
) -> Float64[np.ndarray, "T ..."]:
    """A signal on every tick, NaN where it was not recorded."""
    values = np.full((len(time), *shape), np.nan)
    if name in recorder:
        values[np.searchsorted(time, recorder.times(name))] = recorder[name]
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


def _statuses(recorder: Recorder, time: Float64[np.ndarray, " T"]) -> tuple[str, ...]:
    changes = recorder.statuses
    if not changes:
        return ("none",) * len(time)
    starts = np.array([t for t, _ in changes])
    index = np.searchsorted(starts, time, side="right") - 1
    return tuple(changes[max(int(i), 0)][1] for i in index)
