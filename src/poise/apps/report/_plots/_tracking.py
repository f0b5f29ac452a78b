"""Task errors: a panel for each unit, one colour a task, and the components on demand.

The centre of mass against its reference, axis by axis.
"""

import numpy as np
from jaxtyping import Float64

from poise.apps.report._plots._sheet import (
    PlotFigure,
    TimeSheet,
    above_zero,
    legend_beside,
    log_axis,
)
from poise.apps.report._plots._style import COM, PALETTE, REFERENCE, line_style, number, plain
from poise.apps.report._record import RunView, TaskTrack

_LEAST_SPAN = 0.01
"""Least height of an axis [m]: a COM that stands still must not look as if it shook."""


def com_figure(record: RunView) -> PlotFigure:
    """COM and reference over time."""
    sheet = TimeSheet(record, [1.35] * 3)
    for i, (ax, name) in enumerate(zip(sheet.axes, ("x", "y", "z"), strict=True)):
        sheet.plot(ax, record.com[:, i], label="COM", color=COM)
        if np.isfinite(record.com_reference[:, i]).any():
            dashed = {"linestyle": (0, (4, 2)), "linewidth": 1.1}
            sheet.plot(ax, record.com_reference[:, i], label="reference", color=REFERENCE, **dashed)
        ax.set_ylabel(f"{name} [m]")
        ax.ticklabel_format(axis="y", useOffset=False)
        low, high = ax.get_ylim()
        short = max(0.0, _LEAST_SPAN - (high - low)) / 2.0
        ax.set_ylim(low - short, high + short)
    legend_beside(sheet.axes[0])
    return sheet.finish(
        "com",
        "Centre of mass",
        "The solid line should lie on the dashed reference (x forward, y left, z up, in the "
        "world); where there is no dashed line, nothing was asked of that axis.",
        short="COM",
    )


_LOG_RATIO = 30.0
"""A panel turns logarithmic when its largest error is this many times a typical one."""
_LOG_DECADES = 8.0
"""Decades that a logarithmic panel shows at most, below its largest error."""


def tracking_figures(record: RunView) -> list[PlotFigure]:
    """Error of every task over time, and its components where the record has them."""
    if not record.tasks:
        return []
    figures = [_norms(record)]
    if any(task.components is not None for task in record.tasks):
        figures.append(_components(record))
    return figures


def _norms(record: RunView) -> PlotFigure:
    units = list(dict.fromkeys(task.unit for task in record.tasks))
    sheet = TimeSheet(record, [2.3 if len(units) < 3 else 1.8] * len(units))
    for ax, unit in zip(sheet.axes, units, strict=True):
        tasks = [(i, t) for i, t in enumerate(record.tasks) if t.unit == unit]
        logarithmic = _spreads([t.error for _, t in tasks])
        for i, task in tasks:
            error = above_zero(task.error) if logarithmic else task.error
            label = f"{plain(task.name, 20)} (level {task.level + 1})"
            sheet.plot(ax, error, label=label, **line_style(i))
        if logarithmic:
            log_axis(ax, *_log_bounds([t.error for _, t in tasks]))
        else:
            ax.set_ylim(bottom=0.0)
        ax.set_ylabel(f"error norm [{unit or '-'}]")
        legend_beside(ax)
    return sheet.finish(
        "tracking",
        "Tracking error of each task",
        "Each line is the distance of one task from its target, so lower is better; after a "
        "dashed event line it should fall back, first for the tasks of level 1. A gap means that "
        "the task was not active.",
        short="Tracking",
    )


def _components(record: RunView) -> PlotFigure:
    tasks = [t for t in record.tasks if t.components is not None]
    sheet = TimeSheet(record, [1.25] * len(tasks))
    for ax, task in zip(sheet.axes, tasks, strict=True):
        _draw_components(sheet, ax, task)
    return sheet.finish(
        "components",
        "Components of each task's error",
        "The same errors with their sign, axis by axis; zero is on target.",
        short="Components",
        folded=True,
    )


def _draw_components(sheet: TimeSheet, ax: object, task: TaskTrack) -> None:
    from matplotlib.axes import Axes

    if not isinstance(ax, Axes) or task.components is None:
        return
    k = task.components.shape[1]
    names = task.component_names or tuple(str(i + 1) for i in range(k))
    order = np.argsort([-_greatest(task.components[:, i]) for i in range(k)])
    for place, i in enumerate(order[: len(PALETTE)]):
        label = plain(names[int(i)], 20)
        sheet.plot(ax, task.components[:, int(i)], label=label, **line_style(place))
    ax.set_ylabel(f"[{task.unit or '-'}]")
    shown = "" if k <= len(PALETTE) else f" ({len(PALETTE)} largest of {k})"
    ax.set_title(plain(task.name) + shown, pad=3.0)
    legend_beside(ax)


def _spreads(errors: list[Float64[np.ndarray, " T"]]) -> bool:
    """Whether the errors of a panel differ so much that a linear axis would hide some."""
    largest = [_greatest(e) for e in errors]
    finite = [e[np.isfinite(e)] for e in errors]
    typical = [float(np.median(e)) for e in finite if e.size]
    if not typical or max(largest) <= 0.0:
        return False
    return max(largest) > _LOG_RATIO * max(min(typical), 1e-12)


def _log_bounds(errors: list[Float64[np.ndarray, " T"]]) -> tuple[float, float]:
    """Bounds of a logarithmic panel: short dips to zero, where a sign changes, may leave it."""
    high = 2.0 * max(_greatest(e) for e in errors)
    finite = [e[np.isfinite(e) & (e > 0.0)] for e in errors]
    low = min(float(np.percentile(e, 2.0)) for e in finite if e.size)
    return max(0.5 * low, high * 10.0**-_LOG_DECADES), high


def _greatest(values: Float64[np.ndarray, " T"]) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else 0.0


def worst_tasks(record: RunView) -> list[tuple[str, str]]:
    """Each task's largest error as words, for the page's table of tasks."""
    return [(t.name, f"{number(_greatest(t.error))} {t.unit}".strip()) for t in record.tasks]
