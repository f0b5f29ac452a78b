"""What the robot knew of its base against the truth: drift, velocity and tilt."""

import numpy as np

from poise.apps.report._plots._sheet import PlotFigure, TimeSheet
from poise.apps.report._plots._style import PALETTE
from poise.apps.report._record import RunView


def estimate_figure(record: RunView) -> PlotFigure | None:
    """Errors of the estimate that controller and leader were given, over time."""
    errors = record.base_errors
    if errors is None:
        return None
    sheet = TimeSheet(record, [1.35] * 3)
    tracks = (
        ("position [mm]", 1e3 * errors.drift),
        ("velocity [mm/s]", 1e3 * errors.speed),
        ("tilt [deg]", np.degrees(errors.tilt)),
    )
    for ax, (name, values) in zip(sheet.axes, tracks, strict=True):
        sheet.plot(ax, values, color=PALETTE[0])
        ax.set_ylim(bottom=0.0)
        ax.set_ylabel(name)
    return sheet.finish(
        "estimate",
        "Error of the base's estimate",
        "The robot knows its base from inertial unit, encoders and soles alone; each line is how "
        "far off that is. Velocity and tilt should stay low; the level position is dead reckoning "
        "and drifts as the robot walks. References lie where the robot sees them.",
        short="Estimate",
    )
