"""MuJoCo's own window on a running plant."""

import os
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np

from poise.errors import PoiseError
from poise.sim._plant import Plant

_FRAME_SECONDS = 1.0 / 60.0

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


class NoDisplayError(PoiseError):
    """There is no screen to open a window on."""


class Viewer:
    """A window that shows the plant as it goes, in real time."""

    def __init__(
        self, plant: Plant, handle: Any, model: mujoco.MjModel, data: mujoco.MjData
    ) -> None:
        self._plant, self._handle = plant, handle
        self._model, self._data = model, data
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
            _show(self._plant, self._model, self._data)
            self._handle.sync()
            # Pulled with the mouse.
            self._plant.data.xfrc_applied[:] = self._data.xfrc_applied


def _show(plant: Plant, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Bring data of the drawn model to the plant's state."""
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(plant.model, plant.data, state, _STATE)
    mujoco.mj_setState(model, data, state, _STATE)
    mujoco.mj_forward(model, data)


@contextmanager
def open_viewer(plant: Plant) -> Generator[Viewer]:
    """Open a window on a plant for a `with` block."""
    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise NoDisplayError(
            "the viewer needs a screen: neither DISPLAY nor WAYLAND_DISPLAY is set; "
            "run without --view and look at the video of the report instead"
        )
    import mujoco.viewer

    model = plant.drawn_model()
    data = mujoco.MjData(model)
    _show(plant, model, data)
    try:
        handle = mujoco.viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
    except RuntimeError as error:
        raise NoDisplayError(f"the viewer's window cannot be opened: {error}") from error
    try:
        yield Viewer(plant, handle, model, data)
    finally:
        handle.close()
