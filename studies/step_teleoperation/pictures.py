"""What a run looks like: ZMP and COM over time, as the paper has them, pictures and videos."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.drawing import COM, EVENT, PALETTE, REFERENCE, SUPPORT, ZMP
from poise.apps.teleoperation import TeleopLog, TeleopRun
from poise.errors import MissingExtraError
from poise.locomotion import Mode
from poise.robots import Robot
from poise.sim import Camera, Marker, render_video
from studies.finding import Figure, Film, draw, one_legend
from studies.plan import StudyOptions

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


def paint_sideways(canvas: Any, runs: Mapping[str, TeleopRun], span: tuple[float, float]) -> None:
    """ZMP and COM sideways, a panel a run.

    Args:
        canvas: to draw on.
        runs: by the title of the panel.
        span: times that are shown [s].
    """
    panels = canvas.subplots(1, len(runs), sharey=True)
    for panel, (title, run) in zip(panels, runs.items(), strict=True):
        paint_zmp(panel, run.plant.robot, run.log, 1)
        panel.set_title(title, fontweight="normal", pad=14)
        panel.set_xlim(*span)
        panel.set_xlabel("time [s]")
    one_legend(canvas, panels[0])


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


NO_PICTURES = "This machine cannot draw without a screen: snapshots are left out ({reason})."

_HAND = (0.80, 0.10, 0.10, 0.9)
_WIDTH, _HEIGHT = 300, 420


def snapshots(
    options: StudyOptions,
    name: str,
    title: str,
    caption: str,
    rows: Sequence[tuple[str, TeleopRun, Sequence[float]]],
    *,
    azimuth: float = 145.0,
) -> tuple[tuple[Figure, ...], tuple[str, ...]]:
    """A figure with a row of pictures a run, or a note; neither in the quick version.

    Args:
        options: quick or not.
        name: of the figure.
        title: of it.
        caption: of it.
        rows: a label, a run, and the times of its pictures [s].
        azimuth: direction of view about z, 0 looks along x [deg].

    Returns:
        The figure and no note, or no figure and a note.
    """  # fmt: skip
    if options.quick:
        return (), ()
    try:
        pictures = [_pictures(run, times, azimuth) for _, run, times in rows]
    except MissingExtraError as error:
        return (), (NO_PICTURES.format(reason=error),)

    def paint(canvas: Any) -> None:
        columns = max(len(times) for _, _, times in rows)
        panels = canvas.subplots(len(rows), columns, squeeze=False)
        for line, (label, _, times), images in zip(panels, rows, pictures, strict=True):
            for panel in line:
                panel.set_axis_off()
            for panel, time, image in zip(line, times, images, strict=False):
                panel.imshow(image, interpolation="bilinear")
                panel.set_title(f"{label} {time:.1f} s".strip(), fontweight="normal", fontsize=8)

    height = 2.4 * len(rows) + 0.3
    return (draw(name=name, title=title, caption=caption, height=height, paint=paint),), ()


def _pictures(run: TeleopRun, times: Sequence[float], azimuth: float) -> list[np.ndarray]:
    config = Camera.Config(
        width=_WIDTH, height=_HEIGHT, azimuth=azimuth, elevation=-10.0, distance=1.5
    )
    log, images = run.log, []
    with Camera(run.plant.robot, run.plant.model, config) as camera:
        for time in times:
            i = min(int(np.searchsorted(log.time, time)), len(log) - 1)
            images.append(camera.picture(log.q[i], _hands(log.devices[i])))
    return images


def _hands(hands: np.ndarray) -> list[Marker]:
    return [
        Marker(position=(float(x), float(y), float(z)), radius=0.03, colour=_HAND)
        for x, y, z in hands
        if np.isfinite(x)
    ]


def films(options: StudyOptions, runs: Sequence[tuple[str, str, TeleopRun]]) -> tuple[Film, ...]:
    """A video a run; none in the quick version.

    Args:
        options: quick or not.
        runs: name of the file, title, and the run.
    """
    if options.quick:
        return ()
    made: list[Film] = []
    with tempfile.TemporaryDirectory() as folder:
        for name, title, run in runs:
            path = Path(folder) / f"{name}.mp4"
            try:
                render_video(run.plant, run.log.time, run.log.q, path)
            except MissingExtraError:
                # The snapshots' note says why.
                return ()
            made.append(Film(name=name, title=title, data=path.read_bytes()))
    return tuple(made)
