"""`real_time`: a simulated G1 and its controller in real time, over DDS on the loopback."""

import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from math import isfinite
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from poise.apps.deployment import connect_g1, deploy, g1_gains, stage_deployment
from poise.errors import PoiseError
from poise.hardware import RULES, Trouble
from poise.robots import load_robot
from studies.finding import Finding, Section
from studies.g1_link._bus import PERIOD
from studies.g1_link._kill import patient_watchdog, permitted_priority, prefer_this_process
from studies.g1_link._loops import driven
from studies.g1_link._wire import new_tag, process
from studies.plan import Progress, StudyOptions

_SECONDS, _QUICK = 20.0, 5.0
"""Length of the scenario, and with `--quick` [s]."""

_OLD = next(PERIOD * rule.limit for rule in RULES if rule.trouble is Trouble.LATE_STATE)
"""Age of a state at which the default watchdog damps [s]."""

_PATIENCE = 180.0
"""Longest start of all processes on a busy machine, beside the run [s]."""


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Figures of a run."""

    ended: str  # reason of an early end; "" for none
    seconds: float  # of the run, ramps included [s]
    ages: tuple[float, float, float]  # median, 99th percentile and largest [s]
    ticks: int  # with a command
    old: int  # whose state was older than `_OLD`
    late: int  # in which no new state came
    states: int  # that reached the controller
    missed: int  # periods of the robot without one


def run_controller(pipe: Connection, tag: str, seconds: float, seed: int) -> None:
    """Stand, walk for the middle half of the time, and send the figures."""
    prefer_this_process()
    robot = load_robot("g1")
    gains = g1_gains(robot)
    priority = permitted_priority()
    link = connect_g1(robot, gains.check, interface="lo", tag=tag, priority=priority)
    walk = {"at": 0.25 * seconds, "velocity": [0.3, 0.0, 0.0]}
    rest = {"at": 0.75 * seconds, "velocity": [0.0, 0.0, 0.0]}
    stage = stage_deployment(
        driven([walk, rest], seconds, seed),
        robot,
        link,
        gains.check,
        gains.split,
        kp=gains.kp,
        kd=gains.kd,
    )
    stage.plant.body.watchdog = patient_watchdog(robot)  # type: ignore[attr-defined]
    with TemporaryDirectory() as folder:
        run = deploy(stage, log=Path(folder, "log.mcap"))
    record, body = run.record, stage.plant.body  # type: ignore[attr-defined]
    stamps = np.unique(record["received/time"])
    # Where it ends before its first command, nothing goes out.
    ages = record["age"][record["age"] > 0.0]
    ages = ages if len(ages) else np.array([np.nan])
    median, most, worst = np.percentile(ages, [50.0, 99.0, 100.0]).tolist()
    pipe.send(
        Timing(
            ended=run.ended_early or stage.plant.trouble,
            seconds=float(stamps[-1] - stamps[0]),
            ages=(median, most, worst),
            ticks=len(ages),
            old=int(np.count_nonzero(ages > _OLD)),
            late=body.late,
            states=len(stamps),
            missed=max(0, round((stamps[-1] - stamps[0]) / PERIOD) + 1 - len(stamps)),
        )
    )


def real_time_section(options: StudyOptions, progress: Progress) -> Section:
    """Run both processes."""
    prose = (
        "`python -m poise simulate g1` and a controller by `poise.apps.deployment.deploy`, in two "
        "processes with that of the link as a third, over DDS on the loopback interface: the robot "
        "is lowered, stands, walks at 0.3 m/s for half of the time, and stands. Times depend on "
        "the machine and its load, and are reported, not judged; rules of lateness are off in the "
        "controller's watchdog, so that there are times to report on a busy machine, too.",
    )
    if find_spec("unitree_interface") is None:
        return Section(prose=(*prose, "Left out: far-unitree-sdk is not installed."))
    seconds, tag = _QUICK if options.quick else _SECONDS, new_tag()
    before = os.getloadavg()[0]
    words = [sys.executable, "-m", "poise", "simulate", "g1", "--tag", tag]
    robot = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with process(run_controller, tag, seconds, options.seed) as pipe:
            progress(0.0, 1.0)
            if not pipe.poll(_PATIENCE + seconds):
                raise PoiseError(f"no answer of the controller's process in {_PATIENCE:g} s")
            found = pipe.recv()
    except EOFError:
        raise PoiseError("the controller's process ended; its message is above") from None
    finally:
        robot.send_signal(signal.SIGTERM)
        robot.wait()
    progress(1.0, 1.0)
    return Section(prose=prose, findings=_findings(found, before))


def _findings(found: Timing, before: float) -> tuple[Finding, ...]:
    how = "link under SCHED_FIFO" if permitted_priority() else "no real-time priority"
    load = f"{os.cpu_count()} processors, load average {before:.1f} before, "
    load += f"{os.getloadavg()[0]:.1f} after; {how}"
    named = zip(("median", "99th percentile", "largest"), found.ages, strict=True)
    ages = [
        Finding(
            name=f"from a state's arrival to its command, {which}",
            ours=1e3 * age,
            unit="ms",
            ok=isfinite(age),  # there is none where it ends before its first command
            note=load,
        )
        for which, age in named
    ]
    counts = (
        (f"ticks with a state older than {1e3 * _OLD:g} ms", found.old, f"of {found.ticks}"),
        ("ticks without a new state", found.late, f"of {found.ticks}"),
        ("periods whose state did not reach the controller", found.missed, f"of {found.states}"),
    )
    early = Finding(
        name="ends before the scenario's",
        ours=int(bool(found.ended)),
        paper=0,
        ok=not found.ended,
        note=f"{found.ended} after {found.seconds:.1f} s" if found.ended else "",
    )
    return (
        early,
        *ages,
        *(Finding(name=n, ours=c, ok=True, note=f"{note}; {load}") for n, c, note in counts),
    )
