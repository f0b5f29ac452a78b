"""Joint positions: the joints that come nearest to their limits."""

import numpy as np
from jaxtyping import Float64

from poise.report.plots.joint_groups import short_names
from poise.report.plots.sheet import PlotFigure, TimeSheet, legend_beside
from poise.report.plots.style import LIMIT, line_style
from poise.report.record import RunRecord

_LINES = 6


def joints_figure(record: RunRecord) -> PlotFigure | None:
    """Distance of the six tightest joints to the nearer of their limits."""
    if not record.joint_names:
        return None
    margin = limit_margin(record)
    sheet = TimeSheet(record, [2.1])
    ax = sheet.axes[0]
    names = short_names(record.joint_names)
    least = np.where(np.isfinite(margin), margin, np.inf).min(axis=0)
    for place, i in enumerate(np.argsort(least, kind="stable")[:_LINES]):
        if np.isfinite(least[i]):
            label = names[i]
            sheet.plot(ax, margin[:, i], label=label, **line_style(place))
    ax.axhline(0.0, color=LIMIT, linewidth=1.1, zorder=1)
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -0.03 * (high - low)), high)
    ax.set_ylabel("distance to limit [rad]")
    legend_beside(ax, title="nearest to a limit")
    return sheet.finish(
        "joints",
        "Joint positions near their limits",
        "How far each of the tightest joints is from the nearer of its two limits; the dark line "
        "at zero is the limit itself, and below it the limit is broken.",
        short="Joint limits",
    )


def limit_margin(record: RunRecord) -> Float64[np.ndarray, "T nj"]:
    """Distance of each joint to its nearer position limit [rad], negative beyond it."""
    return np.minimum(record.position - record.position_min, record.position_max - record.position)
