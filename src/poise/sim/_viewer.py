"""MuJoCo's own window on a running plant."""

import os
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

from poise.errors import PoiseError
from poise.sim._plant import Plant

_FRAME_SECONDS = 1.0 / 60.0


class NoDisplayError(PoiseError):
    """There is no screen to open a window on."""


class Viewer:
    """A window that shows the plant as it goes, in real time.

    Args:
        plant: the plant.
        handle: MuJoCo's viewer.
    """

    def __init__(self, plant: Plant, handle: Any) -> None:
        self._plant = plant
        self._handle = handle
        self._began = time.monotonic() - plant.time
        self._next = 0.0

    @property
    def open(self) -> bool:
        """Whether the user has not closed the window."""
        return bool(self._handle.is_running())

    def sync(self) -> None:
        """Show the plant; waits if the plant is ahead of the clock. Call it once a control tick."""
        ahead = self._plant.time - (time.monotonic() - self._began)
        if ahead > 0.0:
            time.sleep(ahead)
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + _FRAME_SECONDS
            self._handle.sync()


@contextmanager
def open_viewer(plant: Plant) -> Generator[Viewer]:
    """Open a window on a plant for a `with` block.

    Raises:
        NoDisplayError: there is no screen, or the window cannot be opened.
    """
    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise NoDisplayError(
            "the viewer needs a screen: neither DISPLAY nor WAYLAND_DISPLAY is set; "
            "run without --view and look at the video of the report instead"
        )
    import mujoco.viewer

    try:
        handle = mujoco.viewer.launch_passive(
            plant.model, plant.data, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:
        raise NoDisplayError(f"the viewer's window cannot be opened: {error}") from error
    try:
        yield Viewer(plant, handle)
    finally:
        handle.close()
