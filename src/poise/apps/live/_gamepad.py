"""`HostGamepad`: a gamepad that is plugged into the machine of the simulation."""

import contextlib
import os
import threading
from collections.abc import Callable
from typing import Any

from poise.apps.live._inputs import OperatorInputs
from poise.errors import PoiseError, import_extra
from poise.locomotion import OperatorSample


class NoGamepadError(PoiseError):
    """There is no gamepad on this machine."""


def sample_from(pressed: Callable[[str], bool], axis: Callable[[str], float]) -> OperatorSample:
    """Return the sample of buttons and axes by SDL's names; `page.js` has the same layout."""

    def stick(name: str, dead: float = 0.15) -> float:
        value = axis(name)
        return -max(-1.0, min(1.0, value)) if abs(value) > dead else 0.0

    up = float(pressed("DPAD_UP") - pressed("DPAD_DOWN"))
    left = float(pressed("DPAD_LEFT") - pressed("DPAD_RIGHT"))
    return OperatorSample(
        lift=(pressed("LEFTSHOULDER"), pressed("RIGHTSHOULDER")),
        move=(stick("LEFTY"), stick("LEFTX")),
        second=(stick("RIGHTY"), stick("RIGHTX")),
        turn=stick("RIGHTX"),
        upright=pressed("A"),
        bend=(0.0, 0.0, up, left, 0.0) if pressed("B") else (up, 0.0, 0.0, 0.0, left),
        neutral=pressed("Y"),
    )


class HostGamepad:
    """Reads the first gamepad sixty times a second in a thread; Back is the emergency stop."""

    def __init__(self, inputs: OperatorInputs, stop: Callable[[], object] = lambda: None) -> None:
        # Without these SDL wants a screen, and pygame greets on the terminal.
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        pygame, controller = (
            import_extra(name, "teleop", "A gamepad", package="pygame-ce")
            for name in ("pygame", "pygame._sdl2.controller")
        )
        self._pygame, self._controller = pygame, controller
        pygame.display.init()
        pygame.joystick.init()
        controller.init()
        self._pad: Any = self._first()
        if self._pad is None and pygame.joystick.get_count():
            raise NoGamepadError(
                "nobody knows where this gamepad has its sticks and buttons",
                got=pygame.joystick.Joystick(0).get_name(),
                wanted="one that SDL knows, or its mapping in SDL_GAMECONTROLLERCONFIG",
            )
        if self._pad is None:
            raise NoGamepadError(
                "no gamepad on this machine",
                wanted="one that is plugged in; one at the computer of the browser works through "
                "the page, with --device browser",
            )
        self._inputs, self._stop, self._emergency = inputs, threading.Event(), stop
        self._landings = 0
        self._thread: threading.Thread | None = None

    def start(self, landings: Callable[[], int]) -> None:
        """Start reading, and shake with each of a number of landings."""
        self._thread = threading.Thread(
            target=self._run, args=(landings,), name="poise gamepad", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """End reading."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self, landings: Callable[[], int]) -> None:
        while not self._stop.wait(1.0 / 60.0):
            self.poll()
            self.shake(landings())

    def poll(self) -> None:
        """Look at the gamepad once."""
        # All events are taken: in a full queue there is no place for a gamepad that goes.
        self._pygame.event.get()
        if self._pad is not None and not self._pad.attached():
            self._pad = None
        if self._pad is None:
            # One that cannot be opened yet may be at the next look.
            with contextlib.suppress(self._pygame.error):
                self._pad = self._first()
        pad, sdl = self._pad, self._pygame
        if pad is not None:
            sample = sample_from(
                lambda name: bool(pad.get_button(getattr(sdl, f"CONTROLLER_BUTTON_{name}"))),
                lambda name: pad.get_axis(getattr(sdl, f"CONTROLLER_AXIS_{name}")) / 2**15,
            )
            self._inputs.take(sample)
            if pad.get_button(sdl.CONTROLLER_BUTTON_BACK):
                self._emergency()

    def shake(self, landings: int) -> None:
        """Shake the gamepad, if it can, where the number of landings has grown."""
        if landings > self._landings and self._pad is not None:
            # Its two motors, from 0 to 1, and how long [ms].
            self._pad.rumble(0.8, 0.4, 80)
        self._landings = landings

    def _first(self) -> Any:
        """The first gamepad whose layout is known; None where there is none."""
        for index in range(self._pygame.joystick.get_count()):
            if self._controller.is_controller(index):
                return self._controller.Controller(index)
        return None
