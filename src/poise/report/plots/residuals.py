"""What each level of the hierarchy could not meet."""

import numpy as np

from poise.report.plots.sheet import PlotFigure, TimeSheet, above_zero, legend_beside, log_axis
from poise.report.plots.style import REFERENCE, line_style, plain
from poise.report.record import RunRecord

_MET = 1e-6
"""A level with a relative residual below this counts as met."""
_FLOOR = 1e-12
"""The axis never shows less than this, which is rounding."""


def residuals_figure(record: RunRecord) -> PlotFigure | None:
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
