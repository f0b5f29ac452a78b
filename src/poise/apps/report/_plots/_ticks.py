"""What each level of the hierarchy could not meet.

Tick times by phase and the status of every command.
"""

from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.report._plots._sheet import (
    WIDTH,
    PlotFigure,
    TimeSheet,
    above_zero,
    legend_beside,
    log_axis,
    log_ticks,
)
from poise.apps.report._plots._style import (
    BAD,
    GOOD,
    INK,
    LIMIT,
    PALETTE,
    REFERENCE,
    inline_svg,
    line_style,
    number,
    plain,
    plain_number,
)
from poise.apps.report._record import RunView

_OK = "ok"
"""The value of `CommandStatus.OK`."""
_TOTAL = "total"
_BINS = 70


def tick_figures(record: RunView) -> list[PlotFigure]:
    """Histogram and percentiles of the tick times, and both tick time and status over time."""
    figures = [_over_time(record)]
    if record.tick_us and np.isfinite(total_tick(record)).any():
        figures.append(_distribution(record))
    return figures


def total_tick(record: RunView) -> Float64[np.ndarray, " T"]:
    """Time of the whole tick [us]: as recorded, or the sum of its phases."""
    if _TOTAL in record.tick_us:
        return record.tick_us[_TOTAL]
    if not record.tick_us:
        return np.full(len(record.time), np.nan)
    return np.sum(list(record.tick_us.values()), axis=0)


def tick_percentiles(record: RunView) -> list[tuple[str, float, float, float]]:
    """p50, p99 and greatest tick time [us] of each phase, and of the whole at the end."""
    parts = [(name, values) for name, values in record.tick_us.items() if name != _TOTAL]
    rows: list[tuple[str, float, float, float]] = []
    for name, values in [*parts, (_TOTAL, total_tick(record))]:
        finite = values[np.isfinite(values)]
        if finite.size:
            p50, p99 = np.percentile(finite, [50, 99])
            rows.append((name, float(p50), float(p99), float(finite.max())))
    return rows


def _over_time(record: RunView) -> PlotFigure:
    sheet = TimeSheet(record, [1.5, 0.3])
    time, status = sheet.axes
    sheet.plot(time, total_tick(record), color=PALETTE[0], linewidth=0.8, label="tick")
    if record.tick_budget_us is not None:
        time.axhline(record.tick_budget_us, color=LIMIT, linewidth=1.1, label="budget")
    time.set_ylim(0.0, _useful_top(record))
    time.set_ylabel("tick time [µs]")
    legend_beside(time)
    _draw_status(status, record, sheet.end)
    return sheet.finish(
        "status",
        "Tick time and command status",
        "Above, how long each control tick took; below, the status of its command, where anything "
        "but an unbroken green bar means that the controller fell back to a safe command.",
        short="Status",
    )


def _useful_top(record: RunView) -> float:
    """Top of the axis [us]: one slow tick may stand out, but not flatten all others."""
    total = total_tick(record)
    total = total[np.isfinite(total)]
    if total.size == 0:
        return 1.0
    top = min(float(total.max()), 6.0 * float(np.percentile(total, 99)))
    budget = record.tick_budget_us
    if budget is not None and budget < 4.0 * top:
        top = max(top, budget)
    return max(1.08 * top, 1e-3)


def _draw_status(ax: Any, record: RunView, end: float) -> None:
    codes = [_OK, *sorted(set(record.status) - {_OK})]
    status = np.array([codes.index(s) for s in record.status])
    edges = np.concatenate([[0], np.flatnonzero(np.diff(status)) + 1, [len(status)]])
    times = np.append(record.time, end)
    colours = [GOOD, BAD, "#CC79A7", "#E69F00", "#56B4E9", INK]
    for code, name in enumerate(codes):
        starts = [i for i in range(len(edges) - 1) if status[edges[i]] == code]
        bars = [(times[edges[i]], times[edges[i + 1]] - times[edges[i]]) for i in starts]
        count = int((status == code).sum())
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


def _distribution(record: RunView) -> PlotFigure:
    from matplotlib.figure import Figure

    rows = tick_percentiles(record)
    figure: Any = Figure(figsize=(WIDTH, 3.3))
    left, right = figure.subplots(
        1, 2, gridspec_kw={"left": 0.08, "right": 0.98, "bottom": 0.16, "top": 0.9, "wspace": 0.3}
    )
    _histogram(left, total_tick(record), rows[-1], record.tick_budget_us)
    _percentile_bars(right, rows)
    return PlotFigure(
        name="ticks",
        title="Where the time of a tick goes",
        short_title="Tick times",
        how_to_read="Left, how often a tick took how long; right, half of all ticks spend less "
        "than the bar in a phase, 99 of 100 less than the line, and none more than the dot.",
        svg=inline_svg(figure, "ticks", "Distribution of tick times"),
    )


def _histogram(
    ax: Any,
    total: Float64[np.ndarray, " T"],
    row: tuple[str, float, float, float],
    budget: float | None,
) -> None:
    finite = total[np.isfinite(total) & (total > 0.0)]
    if finite.size == 0:
        finite = np.ones(1)
    low, high = float(finite.min()) * 0.9, float(finite.max()) * 1.1
    ax.hist(finite, bins=np.geomspace(low, high, _BINS), color=PALETTE[0], alpha=0.85)
    ax.set_xscale("log")
    ax.set(title="Whole tick", xlabel="tick time [µs]", ylabel="ticks [-]")
    marks = [("p50", row[1]), ("p99", row[2])]
    if budget is not None and budget < 3.0 * high:
        marks.append(("budget", budget))
    for name, value in marks:
        dashes = "-" if name == "budget" else (0, (4, 2))
        ax.axvline(value, color=LIMIT, linewidth=1.1, linestyle=dashes)
        ax.annotate(
            f"{name} {number(value)}",
            (value, 1.0),
            xytext=(-3, -3),
            textcoords="offset points",
            xycoords=ax.get_xaxis_transform(),
            rotation=90,
            ha="right",
            va="top",
            fontsize=8,
        )
    _plain_log_ticks(ax, low, max(high, *(v * 1.1 for _, v in marks)))


def _plain_log_ticks(ax: Any, low: float, high: float) -> None:
    """Round numbers on a logarithmic axis that may span less than a decade."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    ax.xaxis.set_major_locator(FixedLocator(log_ticks(low, high)))
    ax.xaxis.set_major_formatter(FuncFormatter(plain_number))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xlim(low, high)


def _percentile_bars(ax: Any, rows: list[tuple[str, float, float, float]]) -> None:
    for i, (name, p50, p99, greatest) in enumerate(rows):
        colour = PALETTE[0] if name == _TOTAL else PALETTE[5]
        ax.barh(i, p50, height=0.62, color=colour, label="p50" if i == 0 else None)
        ax.plot([p50, p99], [i, i], color=INK, linewidth=1.4, zorder=3)
        ax.plot(p99, i, "|", color=INK, markersize=9, zorder=3)
        ax.plot(greatest, i, "o", color=BAD, markersize=4.5, zorder=3)
    ax.set_yticks(range(len(rows)), [plain(name, 16) for name, *_ in rows])
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")
    ax.set(title="By phase: bar p50, line p99, dot max", xlabel="time [µs]")
    ax.set_xlim(left=0.0)
    greatest = [row[3] for row in rows]
    if max(greatest) > 8.0 * rows[-1][2]:
        ax.set_xlim(right=4.0 * rows[-1][2])
        ax.set_title("By phase: bar p50, line p99, dot max (off the axis where missing)")


_MET = 1e-6
"""A level with a relative residual below this counts as met."""
_FLOOR = 1e-12
"""The axis never shows less than this, which is rounding."""


def residuals_figure(record: RunView) -> PlotFigure | None:
    """Relative residual of each level over time, on a logarithmic axis."""
    levels = record.residuals.shape[1]
    if levels == 0:
        return None
    sheet = TimeSheet(record, [2.1])
    ax = sheet.axes[0]
    for i in range(levels):
        label = f"{i + 1}: {plain(record.level_names[i], 22)}" if record.level_names else str(i + 1)
        clipped = np.maximum(above_zero(record.residuals[:, i]), _FLOOR)
        sheet.plot(ax, clipped, label=label, linewidth=0.9, **line_style(i))
    dashed = {"color": REFERENCE, "linestyle": (0, (4, 2)), "linewidth": 1.0}
    ax.axhline(_MET, label="met below 10⁻⁶", zorder=1, **dashed)
    finite = record.residuals[np.isfinite(record.residuals)]
    high = 3.0 * float(finite.max()) if finite.size else 1.0
    low = max(0.5 * float(np.percentile(finite, 0.5)) if finite.size else _FLOOR, _FLOOR / 2.0)
    log_axis(ax, min(low, 1e-8), max(high, 1e-3))
    ax.set_ylabel("relative residual [-]")
    legend_beside(ax, title="level")
    return sheet.finish(
        "residuals",
        "What each level could not meet",
        "A level below the dashed line got all that it asked for; one above it had to give way to "
        "the levels before it, or could not be met at all. Anything under 10⁻¹² is drawn there.",
        short="Residuals",
    )
