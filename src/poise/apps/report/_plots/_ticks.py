"""Tick times by phase, the status of every command, and residuals of the levels."""

from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.pages import BAD, GOOD, INK, inline_svg, line_style, number, plain
from poise.apps.report._plots._sheet import (
    DASHED,
    WIDTH,
    PlotFigure,
    TimeSheet,
    above_zero,
    legend_beside,
    log_axis,
    name_rows,
    stretches,
)
from poise.apps.report._record import RunSignals

_OK = "ok"
"""The value of `CommandStatus.OK`."""
_TOTAL = "total"


def draw_ticks(run: RunSignals) -> list[PlotFigure]:
    """Draw histogram and percentiles of the tick times, and tick time and status over time."""
    figures = [_over_time(run)]
    if np.isfinite(run.total_tick).any():
        figures.append(_distribution(run))
    return figures


def tick_percentiles(run: RunSignals) -> list[tuple[str, float, float, float]]:
    """p50, p99 and greatest tick time [us] of each phase, and of the whole at the end."""
    rows: list[tuple[str, float, float, float]] = []
    for name, values in [*run.tick_us.items(), (_TOTAL, run.total_tick)]:
        finite = values[np.isfinite(values)]
        if finite.size:
            p50, p99 = np.percentile(finite, [50, 99])
            rows.append((name, float(p50), float(p99), float(finite.max())))
    return rows


def _over_time(run: RunSignals) -> PlotFigure:
    sheet = TimeSheet(run, [1.5, 0.3])
    time, status = sheet.axes
    sheet.plot(time, run.total_tick, color="C0", linewidth=0.8, label="tick")
    time.axhline(run.tick_budget_us, color=INK, linewidth=1.1, label="budget")
    time.set_ylim(0.0, _useful_top(run))
    time.set_ylabel("tick time [µs]")
    legend_beside(time)
    _draw_status(status, run, sheet.end)
    return sheet.finish("status", "Tick time and command status")


def _useful_top(run: RunSignals) -> float:
    """Top of the axis [us]: one slow tick may stand out, but not flatten all others."""
    total = run.total_tick
    total = total[np.isfinite(total)]
    if total.size == 0:
        return 1.0
    top = min(float(total.max()), 6.0 * float(np.percentile(total, 99)))
    if run.tick_budget_us < 4.0 * top:
        top = max(top, run.tick_budget_us)
    return max(1.08 * top, 1e-3)


def _draw_status(ax: Any, run: RunSignals, end: float) -> None:
    codes = [_OK, *sorted(set(run.status) - {_OK})]
    colours = [GOOD, BAD, "C3", "C4", "C5", INK]
    for code, name in enumerate(codes):
        on = np.array([status == name for status in run.status])
        bars, count = stretches(run.time, on, end), int(on.sum())
        label = f"{plain(name, 18)} ({count} {'tick' if count == 1 else 'ticks'})"
        colour = colours[min(code, len(colours) - 1)]
        # The edge keeps a single bad tick among thousands visible.
        edge = 0.0 if code == 0 else 1.2
        ax.broken_barh(
            bars, (0.0, 1.0), color=colour, edgecolor=colour, linewidth=edge, label=label
        )
    ax.set_ylim(0.0, 1.0)
    ax.set_yticks([])
    ax.set_ylabel("status [-]", rotation=0, ha="right", va="center")
    ax.grid(visible=False)
    legend_beside(ax)


def _distribution(run: RunSignals) -> PlotFigure:
    from matplotlib.figure import Figure

    rows = tick_percentiles(run)
    figure: Any = Figure(figsize=(WIDTH, 3.3))
    left, right = figure.subplots(
        1, 2, gridspec_kw={"left": 0.08, "right": 0.98, "bottom": 0.16, "top": 0.9, "wspace": 0.3}
    )
    _histogram(left, run.total_tick, rows[-1], run.tick_budget_us)
    _percentile_bars(right, rows)
    title = "Where the time of a tick goes"
    return PlotFigure(name="ticks", title=title, svg=inline_svg(figure, "ticks", title))


def _histogram(
    ax: Any,
    total: Float64[np.ndarray, " T"],
    row: tuple[str, float, float, float],
    budget: float,
) -> None:
    # A nanosecond is below any clock's step, and no logarithm of zero.
    finite = np.maximum(total[np.isfinite(total)], 1e-3)
    low, high = float(finite.min()) * 0.9, float(finite.max()) * 1.1
    ax.hist(finite, bins=np.geomspace(low, high, 70), color="C0", alpha=0.85)
    ax.set(title="Whole tick", xlabel="tick time [µs]", ylabel="ticks [-]")
    marks = [("p50", row[1]), ("p99", row[2])]
    if budget < 3.0 * high:
        marks.append(("budget", budget))
    for name, value in marks:
        dashes = "-" if name == "budget" else (0, (4, 2))
        ax.axvline(value, color=INK, linewidth=1.1, linestyle=dashes)
        # The spaces keep the text off line and edge.
        place = {"transform": ax.get_xaxis_transform(), "ha": "right", "va": "top"}
        ax.text(value, 1.0, f"{name} {number(value)} ", rotation=90, fontsize=8, **place)
    log_axis(ax.xaxis, low, max(high, *(v * 1.1 for _, v in marks)))


def _percentile_bars(ax: Any, rows: list[tuple[str, float, float, float]]) -> None:
    for i, (name, p50, p99, greatest) in enumerate(rows):
        colour = "C0" if name == _TOTAL else "C5"
        ax.barh(i, p50, height=0.62, color=colour, label="p50" if i == 0 else None)
        ax.plot([p50, p99], [i, i], color=INK, linewidth=1.4, zorder=3)
        ax.plot(p99, i, "|", color=INK, markersize=9, zorder=3)
        ax.plot(greatest, i, "o", color=BAD, markersize=4.5, zorder=3)
    name_rows(ax, [plain(name, 16) for name, *_ in rows])
    ax.set(title="By phase: bar p50, line p99, dot max", xlabel="time [µs]")
    ax.set_xlim(left=0.0)
    greatest = [row[3] for row in rows]
    if max(greatest) > 8.0 * rows[-1][2]:
        ax.set_xlim(right=4.0 * rows[-1][2])
        ax.set_title("By phase: bar p50, line p99, dot max (off the axis where missing)")


def draw_residuals(run: RunSignals) -> list[PlotFigure]:
    """Draw the relative residual of each level over time, on a logarithmic axis."""
    levels = run.residuals.shape[1]
    if levels == 0:
        return []
    sheet = TimeSheet(run, [2.1])
    ax, rounding = sheet.axes[0], 1e-12
    for i in range(levels):
        label = f"{i + 1}: {plain(run.level_names[i], 22)}"
        clipped = above_zero(run.residuals[:, i], rounding)
        sheet.plot(ax, clipped, label=label, linewidth=0.9, **line_style(i))
    ax.axhline(1e-6, label="met below 10⁻⁶", zorder=1, **DASHED)
    finite = run.residuals[np.isfinite(run.residuals)]
    high = 3.0 * float(finite.max()) if finite.size else 1.0
    low = max(0.5 * float(np.percentile(finite, 0.5)) if finite.size else rounding, rounding / 2.0)
    log_axis(ax.yaxis, min(low, 1e-8), max(high, 1e-3))
    ax.set_ylabel("relative residual [-]")
    legend_beside(ax, title="level")
    return [sheet.finish("residuals", "What each level could not meet")]
