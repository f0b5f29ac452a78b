"""MuJoCo's own window on a running plant."""

import os
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import mujoco
import numpy as np

from poise.errors import PoiseError
from poise.sim._plant import Plant

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


class NoDisplayError(PoiseError):
    """There is no screen to open a window on."""


class Viewer:
    """A window that shows the plant in real time."""

    def __init__(self, plant: Plant) -> None:
        self._plant, self._model = plant, plant.drawn_model()
        self._data = mujoco.MjData(self._model)
        self._began, self._next = time.monotonic() - plant.time, 0.0
        self._show()
        launch = import_module("mujoco.viewer").launch_passive
        try:
            self.handle: Any = launch(
                self._model, self._data, show_left_ui=False, show_right_ui=False
            )
        except RuntimeError as error:
            raise NoDisplayError(f"the viewer's window cannot be opened: {error}") from error

    @property
    def open(self) -> bool:
        """False once the user has closed the window."""
        return bool(self.handle.is_running())

    def sync(self) -> None:
        """Show the plant, and wait if it is ahead of the clock; call it once a control tick."""
        ahead = self._plant.time - (time.monotonic() - self._began)
        if ahead > 0.0:
            time.sleep(ahead)
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + 1.0 / 60.0
            self._show()
            self.handle.sync()
            # Pulled with the mouse.
            self._plant.data.xfrc_applied[:] = self._data.xfrc_applied

    def _show(self) -> None:
        """Set the data of the drawn model to the plant's state."""
        state = np.empty(mujoco.mj_stateSize(self._model, _STATE))
        mujoco.mj_getState(self._plant.model, self._plant.data, state, _STATE)
        mujoco.mj_setState(self._model, self._data, state, _STATE)
        mujoco.mj_forward(self._model, self._data)


@contextmanager
def open_viewer(plant: Plant) -> Generator[Viewer]:
    """Open a window on a plant for a `with` block."""
    screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not screen:
        raise NoDisplayError(
            "the viewer needs a screen: neither DISPLAY nor WAYLAND_DISPLAY is set; "
            "run without --view and look at the video of the report instead"
        )
    viewer = Viewer(plant)
    try:
        yield viewer
    finally:
        viewer.handle.close()
