"""The plots of the report, a file for each subject; all of them need matplotlib."""

from collections.abc import Callable

from poise.apps.report._plots._sheet import PlotFigure, greatest
from poise.apps.report._plots._ticks import draw_residuals, draw_ticks, tick_percentiles
from poise.apps.report._plots._torque import draw_joints, draw_torques
from poise.apps.report._plots._tracking import draw_com, draw_estimate, draw_tracking
from poise.apps.report._plots._zmp import draw_forces, draw_zmp
from poise.apps.report._record import RunSignals

_PLOTS: tuple[Callable[[RunSignals], list[PlotFigure]], ...] = (
    draw_tracking,
    draw_com,
    draw_zmp,
    draw_forces,
    draw_estimate,
    draw_torques,
    draw_joints,
    draw_residuals,
    draw_ticks,
)
"""In the page's order."""


def draw_plots(run: RunSignals) -> list[PlotFigure]:
    """Draw all plots for which the record has data."""
    return [figure for draw in _PLOTS for figure in draw(run)]


__all__ = ["PlotFigure", "draw_plots", "greatest", "tick_percentiles"]
