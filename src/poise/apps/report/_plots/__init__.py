"""The plots of the report, a file for each subject; all of them need matplotlib."""

from poise.apps.report._plots._estimate import estimate_figure
from poise.apps.report._plots._sheet import PlotFigure
from poise.apps.report._plots._style import house_style, inline_svg, number
from poise.apps.report._plots._ticks import residuals_figure, tick_figures, tick_percentiles
from poise.apps.report._plots._torque import joints_figure, torque_figure
from poise.apps.report._plots._tracking import com_figure, tracking_figures, worst_tasks
from poise.apps.report._plots._zmp import forces_figure, zmp_figures

__all__ = [
    "PlotFigure",
    "com_figure",
    "estimate_figure",
    "forces_figure",
    "house_style",
    "inline_svg",
    "joints_figure",
    "number",
    "residuals_figure",
    "tick_figures",
    "tick_percentiles",
    "torque_figure",
    "tracking_figures",
    "worst_tasks",
    "zmp_figures",
]
