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
    tracks = [
        ("position [mm]", 1e3 * errors.drift),
        ("velocity [mm/s]", 1e3 * errors.speed),
        ("tilt [deg]", np.degrees(errors.tilt)),
    ]
    caption = _CAPTION
    if record.payload is not None and record.payload.any():
        tracks.append(("payload [kg]", record.payload[:, 0]))
        tracks.append(("COM offset [mm]", 1e3 * np.linalg.norm(record.payload[:, 1:], axis=1)))
        caption += _PAYLOAD
    sheet = TimeSheet(record, [1.35] * len(tracks))
    for ax, (name, values) in zip(sheet.axes, tracks, strict=True):
        sheet.plot(ax, values, color=PALETTE[0])
        ax.set_ylim(bottom=min(0.0, float(np.nanmin(values))))
        ax.set_ylabel(name)
    return sheet.finish(
        "estimate",
        "Error of the base's estimate",
        caption,
        short="Estimate",
    )


_CAPTION = (
    "The robot knows its base from inertial unit, encoders and soles alone; each line is how "
    "far off that is. Velocity and tilt should stay low; the level position is dead reckoning "
    "and drifts as the robot walks. References lie where the robot sees them."
)
_PAYLOAD = (
    " Payload and offset are what the soles say the robot weighs beyond its description, and how "
    "far its centre of mass is from there, without what its hands hold."
)
