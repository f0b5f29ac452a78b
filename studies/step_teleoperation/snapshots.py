"""Pictures of a run side by side; where the machine cannot draw, a note in their place."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from poise.apps.teleoperation import TeleopRun
from poise.errors import MissingExtraError
from poise.sim import Camera, Marker
from studies.figure import Figure, draw

NO_PICTURES = "This machine cannot draw without a screen: snapshots are left out ({reason})."

_HAND = (0.80, 0.10, 0.10, 0.9)
_WIDTH, _HEIGHT = 300, 420


def snapshots(
    name: str,
    title: str,
    caption: str,
    rows: Sequence[tuple[str, TeleopRun, Sequence[float]]],
    *,
    azimuth: float = 145.0,
) -> tuple[tuple[Figure, ...], tuple[str, ...]]:
    """A figure with a row of pictures a run, or a note.

    Args:
        name: of the figure.
        title: of it.
        caption: of it.
        rows: a label, a run, and the times of its pictures [s].
        azimuth: direction of view about z, 0 looks along x [deg].

    Returns:
        The figure and no note, or no figure and a note.
    """  # fmt: skip
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
