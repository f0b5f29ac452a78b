"""The centre of mass against its reference, axis by axis."""

import numpy as np

from poise.report.plots.sheet import PlotFigure, TimeSheet, legend_beside
from poise.report.plots.style import COM, REFERENCE
from poise.report.record import RunRecord

_LEAST_SPAN = 0.01
"""Least height of an axis [m]: a COM that stands still must not look as if it shook."""


def com_figure(record: RunRecord) -> PlotFigure:
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
