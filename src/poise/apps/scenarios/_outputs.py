"""What a run leaves behind: `summary.json`, the video and the report."""

import json
from pathlib import Path

import numpy as np

from poise.apps.report import Check, Event, RunRecord, SoleTrack, TaskTrack, write_report
from poise.apps.scenarios._checks import missed_ticks
from poise.apps.scenarios._controllers import is_by_hand, strategy_of
from poise.apps.scenarios._replay import make_replay
from poise.apps.scenarios._run import Progress, Run
from poise.control import PHYSICS_LEVELS
from poise.errors import MissingExtraError
from poise.sim import NoOpenGLError, render_video

SUMMARY, REPORT, VIDEO, LOG = "summary.json", "report.html", "video.mp4", "log.mcap"
"""File names in a run's folder."""


def summarise(run: Run) -> dict[str, object]:
    """The figures of `summary.json`.

    Returns:
        robot, controller, scenario, seed, fell, checks, com_error_max_m, torque_ratio_max,
        residual_max (one a level, relative), missed_ticks, tick_us (p50, p99, max) and
        real_time_factor; figures that could not be measured are None.
    """
    signals = run.signals
    com_error = np.linalg.norm(signals.com_reference - signals.com, axis=1)
    total = np.sum(list(signals.tick_us.values()), axis=0)
    return {
        "robot": run.robot.name,
        "controller": run.scenario.controller.name,
        "scenario": run.scenario.name,
        "seed": run.scenario.seed,
        "fell": run.fell,
        "checks": [
            {"name": c.name, "value": _plain(c.value), "bound": c.bound, "ok": c.ok}
            for c in run.checks
        ],
        "com_error_max_m": _max(com_error),
        "torque_ratio_max": _max(np.abs(signals.torque) / signals.torque_max),
        "residual_max": [_max(column) for column in signals.residuals.T],
        "missed_ticks": missed_ticks(signals),
        "tick_us": {
            "p50": _percentile(total, 50.0),
            "p99": _percentile(total, 99.0),
            "max": _max(total),
        },
        "real_time_factor": float(signals.time[-1] / run.wall_seconds),
    }


def write_summary(summary: dict[str, object], directory: Path) -> Path:
    """Writes `summary.json` into a folder."""
    path = directory / SUMMARY
    path.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return path


def write_video(run: Run, directory: Path, progress: Progress | None = None) -> str:
    """Draws the video of a run.

    Args:
        run: the run.
        directory: folder of the run.
        progress: told how far the drawing is.

    Returns:
        "" where the video was drawn, else why not and what to install.
    """
    try:
        render_video(
            run.plant,
            run.signals.time,
            run.signals.q,
            directory / VIDEO,
            progress=None if progress is None else lambda n, of: progress(float(n), float(of)),
        )
    except (NoOpenGLError, MissingExtraError) as reason:
        return f"No video: {reason}"
    return ""


def write_page(run: Run, summary: dict[str, object], directory: Path, no_video: str | None) -> Path:
    """Writes `report.html`.

    Args:
        run: the run.
        summary: its figures.
        directory: folder of the run.
        no_video: None where no video was wanted, "" where there is one, else why there is none.
    """
    return write_report(make_record(run, summary, no_video), directory)


def make_record(run: Run, summary: dict[str, object], no_video: str | None) -> RunRecord:
    """Everything that the report's page is made from; see `write_page` for the arguments."""
    robot, signals, scenario = run.robot, run.signals, run.scenario
    first = robot.nq - robot.nj
    stack = run.controller.stack
    return RunRecord(
        robot=robot.name,
        controller=f"{scenario.controller.name} ({strategy_of(scenario.controller)})",
        scenario=scenario.name,
        description=scenario.description,
        seed=scenario.seed,
        fell=run.fell,
        ended_early=run.ended_early,
        time=signals.time,
        joint_names=robot.joint_names,
        torque=signals.torque,
        torque_max=robot.tau_max,
        position=signals.q[:, first:],
        position_min=robot.q_min,
        position_max=robot.q_max,
        tasks=tuple(
            TaskTrack(
                name=task.name,
                level=PHYSICS_LEVELS + level,
                unit=task.unit,
                error=signals.task_errors[task.name],
            )
            for level, task in stack.tasks()
        ),
        com=signals.com,
        com_reference=signals.com_reference,
        zmp=signals.zmp,
        zmp_reference=signals.zmp_reference,
        support=signals.support,
        soles=tuple(
            SoleTrack(
                name=name,
                normal_force=signals.sole_forces[name],
                planned=signals.sole_planned[name] > 0.5,
            )
            for name in robot.soles
        ),
        residuals=signals.residuals,
        level_names=()
        if is_by_hand(scenario.controller)
        else (
            "dynamics, torques",
            "contacts, joints",
            *(", ".join(task.name for task in level) for level in stack.levels),
        ),
        status=signals.status,
        tick_us=signals.tick_us,
        tick_budget_us=1e6 * scenario.plant.control_dt,
        events=tuple(_events(run)),
        checks=tuple(
            Check(
                name=c.name, value=c.value, bound=c.bound, relation=c.relation, unit=c.unit, ok=c.ok
            )
            for c in run.checks
        ),
        summary=summary,
        replay=make_replay(run.plant, signals, run.pushes),
        video=VIDEO if no_video == "" else None,
        notes=(no_video,) if no_video else (),
    )


def _events(run: Run) -> list[Event]:
    scenario = run.scenario
    events = [
        Event(time=push.at, label=f"push {push.body}", duration=push.duration)
        for push in scenario.pushes
    ]
    events += [
        Event(
            time=change.at,
            label=f"{'load' if change.load else 'unload'} {change.contact}",
            duration=change.over,
        )
        for change in scenario.contact_changes
    ]
    events += [
        Event(time=motion.at, label=f"{motion.task} moves", duration=motion.over)
        for motion in scenario.motions
    ]
    # The first mode is where the run begins, no event.
    events += [Event(time=time, label=mode) for time, mode in run.signals.modes[1:]]
    return sorted((e for e in events if e.time <= run.signals.time[-1]), key=lambda e: e.time)


def _max(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else None


def _percentile(values: np.ndarray, percent: float) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, percent)) if finite.size else None


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None
