"""Errors of tasks, the centre of mass against its reference, and the estimate of the base."""

import numpy as np
from jaxtyping import Float64

from poise.apps.pages import COM, line_style, plain
from poise.apps.report._plots._sheet import (
    DASHED,
    PlotFigure,
    TimeSheet,
    above_zero,
    greatest,
    legend_beside,
    log_axis,
)
from poise.apps.report._record import RunSignals


def draw_tracking(run: RunSignals) -> list[PlotFigure]:
    """Draw the error of every task over time, a panel a unit."""
    if not run.tasks:
        return []
    units = list(dict.fromkeys(task.unit for task in run.tasks))
    sheet = TimeSheet(run, [2.3 if len(units) < 3 else 1.8] * len(units))
    for ax, unit in zip(sheet.axes, units, strict=True):
        tasks = [(i, t) for i, t in enumerate(run.tasks) if t.unit == unit]
        bounds = _log_bounds([t.error for _, t in tasks])
        for i, task in tasks:
            label = f"{plain(task.name, 20)} (level {task.level + 1})"
            error = above_zero(task.error) if bounds else task.error
            sheet.plot(ax, error, label=label, **line_style(i))
        if bounds:
            log_axis(ax.yaxis, *bounds)
        else:
            ax.set_ylim(bottom=0.0)
        ax.set_ylabel(f"error norm [{unit or '-'}]")
        legend_beside(ax)
    return [sheet.finish("tracking", "Tracking error of each task")]


def _log_bounds(errors: list[Float64[np.ndarray, " T"]]) -> tuple[float, float] | None:
    """Bounds of a logarithmic panel, short dips left out; None where a linear one hides nothing."""
    finite = [e[np.isfinite(e)] for e in errors]
    typical = [float(np.median(e)) for e in finite if e.size]
    largest = max(greatest(e) for e in errors)
    if not typical or not largest > 30.0 * max(min(typical), 1e-12):
        return None
    low = min(float(np.percentile(e[e > 0.0], 2.0)) for e in finite if (e > 0.0).any())
    return max(0.5 * low, 2e-8 * largest), 2.0 * largest


def draw_com(run: RunSignals) -> list[PlotFigure]:
    """Draw CoM and reference over time."""
    sheet = TimeSheet(run, [1.35] * 3)
    for i, (ax, name) in enumerate(zip(sheet.axes, ("x", "y", "z"), strict=True)):
        sheet.plot(ax, run.com[:, i], label="CoM", color=COM)
        if np.isfinite(run.com_reference[:, i]).any():
            sheet.plot(ax, run.com_reference[:, i], label="reference", **DASHED)
        ax.set_ylabel(f"{name} [m]")
        ax.ticklabel_format(axis="y", useOffset=False)
        low, high = ax.get_ylim()
        # A centimetre at least: a CoM that stands still must not look as if it shook.
        short = max(0.0, 0.01 - (high - low)) / 2.0
        ax.set_ylim(low - short, high + short)
    legend_beside(sheet.axes[0])
    return [sheet.finish("com", "Centre of mass")]


def draw_estimate(run: RunSignals) -> list[PlotFigure]:
    """Draw errors of the estimate that controller and leader had, and the payload found."""
    errors = run.base_errors
    if errors is None:
        return []
    tracks = [
        ("position [mm]", 1e3 * errors.drift),
        ("velocity [mm/s]", 1e3 * errors.speed),
        ("tilt [deg]", np.degrees(errors.tilt)),
    ]
    if run.payload is not None and run.payload.any():
        tracks.append(("payload [kg]", run.payload[:, 0]))
        tracks.append(("CoM offset [mm]", 1e3 * np.linalg.norm(run.payload[:, 1:], axis=1)))
    sheet = TimeSheet(run, [1.35] * len(tracks))
    for ax, (name, values) in zip(sheet.axes, tracks, strict=True):
        sheet.plot(ax, values, color="C0")
        ax.set_ylim(bottom=min(0.0, float(np.nanmin(values))))
        ax.set_ylabel(name)
    return [sheet.finish("estimate", "Error of the base's estimate")]
