"""`write_report`: from the record of a run to `report.html`."""

from collections.abc import Callable
from pathlib import Path

from poise.apps.report._page import page_html
from poise.apps.report._plots import (
    PlotFigure,
    com_figure,
    estimate_figure,
    forces_figure,
    house_style,
    joints_figure,
    residuals_figure,
    tick_figures,
    torque_figure,
    tracking_figures,
    zmp_figures,
)
from poise.apps.report._record import RunView

_Drawing = Callable[[RunView], list[PlotFigure] | PlotFigure | None]
_PLOTS: tuple[_Drawing, ...] = (
    tracking_figures,
    com_figure,
    zmp_figures,
    forces_figure,
    estimate_figure,
    torque_figure,
    joints_figure,
    residuals_figure,
    tick_figures,
)
"""The plots, in the page's order."""


def write_report(run: RunView, directory: Path) -> Path:
    """Write one self-contained page about a run; it needs no network and no server.

    The same record gives the same bytes.
    """
    page = page_html(run, draw_plots(run))
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / "report.html"
    path.write_text(page, encoding="utf-8", newline="\n")
    return path


def draw_plots(run: RunView) -> list[PlotFigure]:
    """All plots for which the record has something to show."""
    figures: list[PlotFigure] = []
    with house_style():
        for draw in _PLOTS:
            drawn = draw(run)
            if isinstance(drawn, PlotFigure):
                figures.append(drawn)
            elif drawn is not None:
                figures.extend(drawn)
    return figures
