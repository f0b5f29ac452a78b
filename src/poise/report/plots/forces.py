"""Ground forces of the soles, with the contacts that the controller counted on."""

from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from poise.report.plots.sheet import PlotFigure, TimeSheet, legend_beside
from poise.report.plots.style import EVENT, line_style, plain
from poise.report.record import RunRecord


def forces_figure(record: RunRecord) -> PlotFigure | None:
    """Normal force of every sole, their sum, and a bar while each contact is planned."""
    if not record.soles:
        return None
    sheet = TimeSheet(record, [2.0, max(0.22 * len(record.soles), 0.3)])
    force, phases = sheet.axes
    if len(record.soles) > 1:
        total = np.nansum([s.normal_force for s in record.soles], axis=0)
        sheet.plot(force, total, color=EVENT, linewidth=0.9, label="sum")
    for i, sole in enumerate(record.soles):
        sheet.plot(force, sole.normal_force, label=plain(sole.name), **line_style(i))
        bars = _intervals(record.time, sole.planned, sheet.end)
        phases.broken_barh(bars, (i - 0.32, 0.64), color=line_style(i)["color"], alpha=0.75)
    force.set_ylim(bottom=min(0.0, force.get_ylim()[0]))
    force.set_ylabel("normal force [N]")
    _name_rows(phases, [plain(s.name, 14) for s in record.soles])
    legend_beside(force)
    return sheet.finish(
        "forces",
        "Ground forces of the soles",
        "Each line is what one sole carries; a bar below shows when the controller counts on that "
        "contact, and outside it the line should be at zero.",
        short="Forces",
    )


def _name_rows(ax: Any, names: list[str]) -> None:
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.set_yticks(range(len(names)), names)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")


def _intervals(
    time: Float64[np.ndarray, " T"], on: Bool[np.ndarray, " T"], end: float
) -> list[tuple[float, float]]:
    """Start and length of each stretch in which a flag is set [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    times = np.append(time, end)
    return [
        (float(times[a]), float(times[b] - times[a]))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
