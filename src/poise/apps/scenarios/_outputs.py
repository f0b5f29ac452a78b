"""Files of a run: `summary.json`, the video and the report."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from poise.apps.report import RunSignals, write_report
from poise.apps.scenarios._checks import missed_ticks
from poise.apps.scenarios._metrics import METRICS
from poise.apps.scenarios._replay import make_replay
from poise.apps.scenarios._run import Progress, Run
from poise.apps.scenarios._signals import collect_signals
from poise.apps.teleoperation import plant_from_json, recorded_robot
from poise.errors import ConfigurationError, MissingExtraError
from poise.robots import Robot
from poise.sim import Plant, Push, RunRecord, read_log, render_video

SUMMARY, LOG = "summary.json", "log.mcap"
VIDEO, POSTER = "video.mp4", "video.jpg"
"""File names in a run's folder."""


def summarise(run: Run) -> dict[str, object]:
    """Figures of `summary.json`."""
    signals, rows = run.signals, np.ones(len(run.signals.time), dtype=np.bool_)
    ticks = signals.total_tick[np.isfinite(signals.total_tick)]
    percentiles = np.percentile(ticks, (50.0, 99.0, 100.0)).tolist() if ticks.size else [None] * 3

    def measured(metric: str, subject: str = "") -> float | None:
        value = METRICS[metric].measure(signals, subject, None, rows).value
        return value if np.isfinite(value) else None

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
                "value": c.value if np.isfinite(c.value) else None,
                "relation": c.relation,
                "bound": c.bound,
                "unit": c.unit,
                "ok": c.ok,
                "worst_time_s": c.time,
                "mechanism": c.mechanism,
            }
            for c in run.checks
        ],
        "com_error_max_m": measured("com_error_max"),
        "torque_ratio_max": measured("torque_ratio_max"),
        "torque_step_max": measured("torque_step_max"),
        "residual_max": [
            measured("residual_max", str(level + 1)) for level in range(signals.residuals.shape[1])
        ],
        "missed_ticks": missed_ticks(signals),
        "tick_us": dict(zip(("p50", "p99", "max"), percentiles, strict=True)),
        "real_time_factor": float(signals.time[-1] / run.wall_seconds),
    }


def write_summary(summary: dict[str, object], directory: Path) -> Path:
    """Write `summary.json` into a folder."""
    path = directory / SUMMARY
    path.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return path


def write_video(run: Run, directory: Path, progress: Progress | None = None) -> str:
    """Draw the video of a run; return why there is none, or ""."""
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
    """Remove a video of an earlier run, which would pass for this one's."""
    for name in (VIDEO, POSTER):
        (directory / name).unlink(missing_ok=True)


def write_page(run: Run, summary: dict[str, object], directory: Path, no_video: str | None) -> Path:
    """Write `report.html` with the video, or with the reason why there is none, unless None."""
    view = replace(
        run.signals,
        checks=run.checks,
        summary=summary,
        fell=run.fell,
        ended_early=run.ended_early,
        video=VIDEO if no_video == "" else None,
        notes=(no_video,) if no_video else (),
    )
    return _write_page(view, run.record, run.plant, directory)


def _write_page(signals: RunSignals, record: RunRecord, plant: Plant, directory: Path) -> Path:
    pushes = json.loads(record.metadata.get("pushes", "[]"))
    pushes = [Push(**(push | {"force": tuple(push["force"])})) for push in pushes]
    replay = make_replay(plant, signals, pushes)
    return write_report(replace(signals, replay=replay), directory)


def report(
    run: Run | RunRecord | str | Path, directory: str | Path, robot: Robot | None = None
) -> Path:
    """Write `report.html` for a run of a scenario, a record, or the log of a record.

    A scenario's run is reported with its checks and its figures, which `summary.json` beside the
    page has too.

    Args:
        run: run of a scenario; or a record as a `Recorder` made it, or the file of its log.
        directory: folder of the page; made if it does not exist.
        robot: robot of the record; that of the catalog with the name in the record when None.

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
    plant = Plant(robot, plant_from_json(json.loads(record.metadata["plant"])))
    return _write_page(collect_signals(record, robot), record, plant, directory)
