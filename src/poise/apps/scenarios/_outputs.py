"""What a run leaves behind: `summary.json`, the video and the report."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.report import Check, Event, RunView, SoleTrack, TaskTrack, write_report
from poise.apps.scenarios._checks import missed_ticks
from poise.apps.scenarios._replay import make_replay
from poise.apps.scenarios._run import Progress, Run
from poise.apps.scenarios._signals import RunSignals, collect_signals
from poise.apps.teleoperation import plant_from_json, recorded_robot
from poise.control import PHYSICS_LEVELS
from poise.errors import ConfigurationError, MissingExtraError
from poise.robots import Robot
from poise.sim import Plant, Push, RunRecord, read_log, render_video

SUMMARY, REPORT, LOG = "summary.json", "report.html", "log.mcap"
VIDEO, POSTER = "video.mp4", "video.jpg"
"""File names in a run's folder."""


def summarise(run: Run) -> dict[str, object]:
    """The figures of `summary.json`."""
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
            {
                "name": c.name,
                "metric": c.metric,
                "value": _plain(c.value),
                "relation": c.relation,
                "bound": c.bound,
                "unit": c.unit,
                "ok": c.ok,
                "worst_time_s": c.time,
                "mechanism": c.mechanism,
            }
            for c in run.checks
        ],
        "com_error_max_m": _max(com_error),
        "torque_ratio_max": _max(np.abs(signals.torque) / signals.torque_max),
        "torque_step_max": _max(np.abs(np.diff(signals.torque, axis=0)) / signals.torque_max),
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
    """Draws the video of a run."""
    discard_video(directory)
    try:
        render_video(
            run.plant,
            run.signals.time,
            run.signals.q,
            directory / VIDEO,
            poster=directory / POSTER,
            progress=None if progress is None else lambda n, of: progress(float(n), float(of)),
        )
    except MissingExtraError as reason:
        return f"No video: {reason}"
    except BaseException:
        # Half a video looks like a whole one.
        discard_video(directory)
        raise
    return ""


def discard_video(directory: Path) -> None:
    """Removes a video that an earlier run has left, which would pass for this one's."""
    for name in (VIDEO, POSTER):
        (directory / name).unlink(missing_ok=True)


def write_page(run: Run, summary: dict[str, object], directory: Path, no_video: str | None) -> Path:
    """Writes `report.html`.

    Args:
        run: the run.
        summary: its figures.
        directory: folder of the run.
        no_video: None where no video was wanted, "" where there is one, else why there is none.
    """
    view = make_view(run.record, run.robot, plant=run.plant, checks=run.checks, summary=summary)
    video = VIDEO if no_video == "" else None
    notes = (no_video,) if no_video else ()
    view = replace(view, fell=run.fell, ended_early=run.ended_early, video=video, notes=notes)
    return write_report(view, directory)


def report(
    run: Run | RunRecord | str | Path, directory: str | Path, robot: Robot | None = None
) -> Path:
    """Writes `report.html`: of a scenario's run, or from nothing but a record or its log.

    A scenario's run is reported with its checks and its figures, which `summary.json` beside the
    page has too.

    Args:
        run: of a scenario; or a record as a `Recorder` made it, or the file of its log.
        directory: where the page goes; made if it does not exist.
        robot: of the record; that of the catalog with the name in the record when None.

    Returns:
        Path of the page.

    Raises:
        PoiseError: the file is no log, the record is of no rollout, the catalog has no robot of the
            name in it, as where that came from a file, or the directory is a file.
    """
    directory = Path(directory)
    if directory.exists() and not directory.is_dir():
        raise ConfigurationError(
            "a report goes into a folder", got=str(directory), wanted="no file of that name"
        )
    if isinstance(run, Run):
        directory.mkdir(parents=True, exist_ok=True)
        summary = summarise(run)
        write_summary(summary, directory)
        return write_page(run, summary, directory, no_video=None)
    record = run if isinstance(run, RunRecord) else read_log(run)
    lacking = [key for key in ("plant", "tasks", "levels") if key not in record.metadata]
    lacking += ["robot"] if robot is None and "robot" not in record.metadata else []
    if lacking:
        raise ConfigurationError(
            f"a record that does not say its {', '.join(lacking)} cannot be reported",
            got=sorted(record.metadata),
            wanted="one that a Recorder made of a rollout",
        )
    if robot is None:
        what = "the record" if isinstance(run, RunRecord) else f"the log {Path(run).name}"
        robot = recorded_robot(record.metadata["robot"], what)
    return write_report(make_view(record, robot), directory)


def make_view(
    record: RunRecord,
    robot: Robot,
    *,
    plant: Plant | None = None,
    checks: Sequence[Check] = (),
    summary: Mapping[str, object] | None = None,
) -> RunView:
    """Everything that the report's page is made from."""
    about, signals = record.metadata, collect_signals(record, robot)
    config = plant_from_json(json.loads(about["plant"]))
    plant = Plant(robot, config) if plant is None else plant
    pushes = [Push(**(p | {"force": tuple(p["force"])})) for p in _read(about, "pushes")]
    first = robot.nq - robot.nj
    strategy = f" ({about['strategy']})" if "strategy" in about else ""
    return RunView(
        robot=robot.name,
        controller=about.get("controller", "") + strategy,
        scenario=about.get("scenario", "a run"),
        description=about.get("description", ""),
        seed=int(about.get("seed", 0)),
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
                level=PHYSICS_LEVELS + task.level,
                unit=task.unit,
                error=signals.task_errors[task.name],
            )
            for task in signals.tasks
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
        base_errors=signals.base_errors,
        payload=_payload(record),
        residuals=signals.residuals,
        level_names=signals.level_names,
        status=signals.status,
        tick_us=signals.tick_us,
        tick_budget_us=1e6 * config.control_dt,
        events=tuple(_events(record, signals)),
        checks=tuple(checks),
        summary=summary or {},
        replay=make_replay(plant, signals, pushes),
    )


def _payload(record: RunRecord) -> Float64[np.ndarray, "T 4"] | None:
    """What the robot was found to carry, where it was looked for."""
    if "payload_estimate" not in record:
        return None
    payload = record["payload_estimate"].copy()
    if "held_estimate" in record:
        payload[:, 0] += record["held_estimate"].sum(axis=1)
    return payload


def _events(record: RunRecord, signals: RunSignals) -> list[Event]:
    known = _read(record.metadata, "events")
    events = [Event(time=time, label=label, duration=seconds) for time, label, seconds in known]
    # The first mode is where the run begins, no event.
    events += [Event(time=time, label=mode) for time, mode in signals.modes[1:]]
    return sorted((e for e in events if e.time <= signals.time[-1]), key=lambda e: e.time)


def _read(about: Mapping[str, str], name: str) -> list[Any]:
    return json.loads(about.get(name, "[]"))


def _max(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else None


def _percentile(values: np.ndarray, percent: float) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, percent)) if finite.size else None


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None
