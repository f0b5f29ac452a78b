"""Drawings of ZMP and COM over time, as the paper has them."""

from typing import Any

import numpy as np

from benchmarks.drawing import COM, EVENT, PALETTE, REFERENCE, SUPPORT, ZMP
from poise.apps.teleoperation import TeleopLog
from poise.locomotion import Mode
from poise.robots import Robot

_AXES = ("x forward [m]", "y left [m]")


def paint_zmp(panel: Any, robot: Robot, log: TeleopLog, axis: int, *, start: float = 0.2) -> None:
    """ZMP, its reference, CT-ZMP, COM and the support polygon along one axis, with mode changes.

    Args:
        panel: axes to draw on.
        robot: whose soles.
        log: of the run.
        axis: 0 forward, 1 left.
        start: nothing earlier is drawn: soles sink in at first [s].
    """
    rows = log.time >= start
    time = log.time[rows]
    low, high = _support(robot, log, axis)
    panel.fill_between(
        time, low[rows], high[rows], color=SUPPORT, alpha=0.12, linewidth=0, label="support"
    )
    panel.plot(
        time, log.cart_table_zmp[rows, axis], color=PALETTE[4], linewidth=0.9, label="CT-ZMP"
    )
    panel.plot(time, log.zmp[rows, axis], color=ZMP, label="ZMP")
    panel.plot(time, log.com[rows, axis], color=COM, label="COM")
    panel.plot(
        time, log.zmp_reference[rows, axis], color=REFERENCE, linestyle="--", label="ZMP reference"
    )
    modes = tuple(Mode)
    for i in np.flatnonzero(np.diff(log.mode)) + 1:
        if log.time[i] >= start:
            panel.axvline(log.time[i], color=EVENT, linewidth=0.7)
            panel.text(
                log.time[i], 1.01, modes[log.mode[i]].name, fontsize=7, color=EVENT,
                transform=panel.get_xaxis_transform(),
            )  # fmt: skip
    panel.set_ylabel(_AXES[axis])
    panel.margins(x=0.01)


def one_legend(canvas: Any, panel: Any) -> None:
    """The legend of one panel for the whole drawing."""
    handles, labels = panel.get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside upper left", ncols=len(labels))


def _support(robot: Robot, log: TeleopLog, axis: int) -> tuple[np.ndarray, np.ndarray]:
    half = np.array(
        [
            0.5 * (sole.length if axis == 0 else sole.width)
            for sole in list(robot.soles.values())[:2]
        ]
    )
    stands = np.ones((len(log), 2), dtype=np.bool_)
    for i, mode in enumerate(Mode):
        if mode.single and mode.support is not None:
            stands[log.mode == i, 1 - mode.support] = False
    centre = log.soles[:, :, axis]
    low = np.where(stands, centre - half, np.inf).min(axis=1)
    high = np.where(stands, centre + half, -np.inf).max(axis=1)
    return low, high
