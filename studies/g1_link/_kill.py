"""`kill`: `kill -9` of a controller's process in phases of a walk, with the robot simulated."""

import math
import multiprocessing
import os
import signal
import struct
import time
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.deployment import deploy, g1_gains, stage_deployment
from poise.hardware import (
    RULES,
    Link,
    MotorCommand,
    PlantLink,
    ProcessLink,
    Trouble,
    Watchdog,
)
from poise.robots import Robot, load_robot
from poise.sim import HoistedPlant, read_log
from studies.finding import Finding, Section, Table
from studies.g1_link._bus import PERIOD, g1_plant
from studies.g1_link._loops import driven
from studies.plan import Progress, Steps, StudyOptions

_PHASES, _QUICK = 10, 2
"""Kills, and with `--quick`."""

_BEGIN, _STRIDE = 15.2, 1.2
"""Time of the first kill, two seconds into a walk, and length of two steps with their double
supports, over which the kills are spread; either is of the simulated robot [s]."""

_DAMPED = 0.02
"""Bound on the time to damping, and on what the log may lose [s]."""

_TRIES = 3
"""Of a run in which the robot does not walk when it is killed: another process may delay it."""

_AFTER = 0.4
"""Time for which the damped robot is watched [s]."""

_PATIENCE = 120.0
"""Longest start and walk on a busy machine [s]."""

_LINE = struct.Struct("6d")
"""Wall time [s], time of the robot [s], largest stiffness [N m/rad], largest torque by its limit,
one after a fall, and the sum of all numbers."""

_PRIORITY = 80
"""Of a link's process that simulates no robot."""

_LATE = Trouble.LATE_STATE, Trouble.LATE_TICK, Trouble.GAP
"""Rules that the controller's watchdog does without: it is to walk until it is killed, on machines
that are not always in time, too. What is looked at, the process of the link, is as ever."""


@dataclass(frozen=True, kw_only=True)
class Killed:
    """One kill."""

    phase: float  # of the two steps
    tries: int  # runs that it took
    damped: float  # from the kill to the first damping [s]; infinite without a kill
    stiff: int  # commands with stiffness or torque later than `_DAMPED`
    torque: float  # largest torque of a motor from the kill on, by its limit
    finite: bool  # whether all numbers of the robot and its commands are
    lost: float  # from the last row of the log to the kill [s]


class _Robot(PlantLink):
    """Simulated robot that writes down its commands.

    Its time passes by them, and while its controller lives by those with stiffness or torque: a
    robot does not fall because a busy machine delays its controller until the link damps.
    """

    def __init__(self, plant: HoistedPlant, path: str) -> None:
        super().__init__(plant, load_cells=False)
        self._robot, self._controller = plant, multiprocessing.parent_process()
        self._file = open(path, "ab", buffering=0)  # noqa: SIM115

    def write(self, command: MotorCommand) -> None:
        """Apply a command, and write it down."""
        controller = self._controller
        driven = float(max(command.kp.max(), np.abs(command.tau).max()))
        if driven > 0.0 or controller is None or not controller.is_alive():
            super().write(command)
        state, plant = self.read(), self._robot
        torque = float(np.max(np.abs(plant.applied_torque) / plant.robot.tau_max))
        numbers = [command.q, command.dq, command.kp, command.kd, command.tau, state.q, state.dq]
        total = float(np.concatenate(numbers).sum())
        line = time.monotonic(), state.time, driven, torque, float(plant.fallen), total
        self._file.write(_LINE.pack(*line))


def make_robot(path: str, seed: int) -> Link:
    """Make the robot, in the process of the link."""
    return _Robot(HoistedPlant(load_robot("g1"), g1_plant(), seed=seed), path)


def walk(folder: str, seed: int, ready: Connection) -> None:
    """Walk until the end of the process."""
    prefer_this_process()
    robot = load_robot("g1")
    gains = g1_gains(robot)
    make = partial(make_robot, f"{folder}/robot", seed)
    # Without priority: beside a simulated robot that has it other threads wait for a processor.
    link = ProcessLink(make, gains.check)
    scenario = driven([{"at": 1.0, "velocity": [0.3, 0.0, 0.0]}], 60.0, seed)
    stage = stage_deployment(
        scenario,
        robot,
        link,
        gains.check,
        gains.split,
        kp=gains.kp,
        kd=gains.kd,
    )
    stage.plant.body.watchdog = patient_watchdog(robot)  # type: ignore[attr-defined]
    ready.send(link.pid)
    deploy(stage, log=Path(folder, "log.mcap"))


def patient_watchdog(robot: Robot) -> Watchdog:
    """Make a watchdog without rules of lateness."""
    return Watchdog(robot, rules=[rule for rule in RULES if rule.trouble not in _LATE])


def prefer_this_process() -> None:
    """Raise the share of the processor of this process, where that is permitted."""
    # Not by SCHED_FIFO: Linux stops those processes for 50 ms in each second that they fill.
    with suppress(AttributeError, OSError):
        os.setpriority(os.PRIO_PROCESS, 0, -20)


def permitted_priority() -> int | None:
    """Return the priority of real-time processes; None where there may be none."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    except (AttributeError, OSError):
        return None
    return _PRIORITY


def kill_at(phase: float, seed: int) -> Killed:
    """Kill a walk at a phase."""
    for tries in range(1, _TRIES + 1):
        with TemporaryDirectory() as folder:
            found = _kill(folder, _BEGIN + _STRIDE * phase, seed)
            if found is not None:
                return Killed(phase=phase, tries=tries, **found)
    none = math.inf
    return Killed(
        phase=phase, tries=_TRIES, damped=none, stiff=0, torque=none, finite=False, lost=none
    )


def _kill(folder: str, at: float, seed: int) -> dict[str, Any] | None:
    spawn = multiprocessing.get_context("spawn")
    near, far = spawn.Pipe(duplex=False)
    controller = spawn.Process(target=walk, args=(folder, seed, far))
    controller.start()
    far.close()
    try:
        pid = near.recv()
        assert isinstance(pid, int)
        path, end = Path(folder, "robot"), time.monotonic() + _PATIENCE
        while not _walks(path, at):
            if controller.exitcode is not None or time.monotonic() > end:
                return None
            time.sleep(0.5 * PERIOD)
        killed = time.monotonic()
        os.kill(controller.pid or 0, signal.SIGKILL)
        time.sleep(_AFTER)
        lines = _lines(path)
        os.kill(pid, signal.SIGTERM)
    except EOFError:
        return None
    finally:
        controller.kill()
        controller.join()
    before, after = lines[lines[:, 0] <= killed], lines[lines[:, 0] > killed]
    if before[-1, 2] == 0.0 or before[-1, 4] or not len(after):
        return None  # It was damped, or fell, before.
    last = read_log(Path(folder, "log.mcap"))["received/arrived"][-1]
    free = after[after[:, 2] == 0.0, 0]
    return {
        "damped": float(free[0] - killed) if len(free) else math.inf,
        "stiff": int(np.count_nonzero(after[after[:, 0] > killed + _DAMPED, 2])),
        "torque": float(after[:, 3].max()),
        "finite": bool(np.isfinite(lines).all()),
        "lost": float(killed - last),
    }


def _walks(path: Path, at: float) -> bool:
    """Return True once the last command drives the robot, and the robot's time has come."""
    size = path.stat().st_size // _LINE.size if path.exists() else 0
    if not size:
        return False
    with path.open("rb") as file:
        file.seek((size - 1) * _LINE.size)
        _, time, driven, *_ = _LINE.unpack(file.read(_LINE.size))
    return time >= at and driven > 0.0


def _lines(path: Path) -> Float64[np.ndarray, "n 6"]:
    data = path.read_bytes()
    return np.array(list(_LINE.iter_unpack(data[: len(data) // _LINE.size * _LINE.size])))


def kill_section(options: StudyOptions, progress: Progress) -> Section:
    """Kill walks at phases of two steps."""
    count = _QUICK if options.quick else _PHASES
    steps, found = Steps(progress, count), list[Killed]()
    for k in range(count):
        steps.next()
        found.append(kill_at(k / count, options.first_seed + k))
    steps.finish()
    note = f"without real-time priority, load {os.getloadavg()[0]:.1f}"
    return Section(
        prose=(
            "A G1 with motors, simulated in the process of a `ProcessLink`, walks at 0.3 m/s under "
            "`deploy`, whose process is killed by SIGKILL. Rules of lateness are off in the "
            "controller's watchdog: it is to walk until then on a machine that others use, too.",
        ),
        findings=(
            _at_most("time to damping", 1e3 * max(k.damped for k in found), 1e3 * _DAMPED, note),
            _at_most("rows of the log lost", 1e3 * max(k.lost for k in found), 1e3 * _DAMPED, note),
            Finding(
                name="commands with stiffness or torque 20 ms after a kill",
                ours=sum(k.stiff for k in found),
                paper=0,
                ok=not any(k.stiff for k in found),
            ),
            Finding(
                name="largest torque of a motor from the kill on, by its limit",
                ours=max(k.torque for k in found),
                paper=1.0,
                ok=max(k.torque for k in found) <= 1.0 + 1e-9,  # rounding
            ),
            Finding(
                name="kills with a number that is not finite",
                ours=sum(not k.finite for k in found),
                paper=0,
                ok=all(k.finite for k in found),
            ),
        ),
        tables=(
            Table(
                title="Kills",
                header="phase | runs | to damping [ms] | log lost [ms] | torque",
                rows=tuple(
                    (k.phase, k.tries, 1e3 * k.damped, 1e3 * k.lost, k.torque) for k in found
                ),
                caption="Phases are of two steps; torque is the largest by its limit.",
            ),
        ),
    )


def _at_most(name: str, value: float, bound: float, note: str) -> Finding:
    return Finding(name=name, ours=value, paper=bound, unit="ms", ok=value <= bound, note=note)
