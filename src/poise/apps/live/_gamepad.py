"""`HostGamepad`: a gamepad that is plugged into the machine on which the robot is simulated."""

import os
import threading
from collections.abc import Sequence
from typing import Any

from poise.apps.live._inputs import OperatorInputs, Pad
from poise.errors import MissingExtraError, PoiseError

_A, _LEFT_SHOULDER, _RIGHT_SHOULDER = 0, 4, 5
_DEAD = 0.15
"""A stick nearer to the middle than this is in the middle."""
_PERIOD = 1.0 / 60.0


class NoGamepadError(PoiseError):
    """There is no gamepad on this machine."""


def pad_from(buttons: Sequence[bool | int], axes: Sequence[float | int]) -> Pad:
    """What a gamepad of the usual layout asks for; the page maps its own the same way.

    The shoulder buttons hold the left and the right foot up, either stick moves the foot that is
    up, or each its own with both of them up; A brings the torso upright. A robot that is driven
    goes where the left stick points, and turns with the right one.

    Args:
        buttons: whether each is pressed.
        axes: from -1 to 1: left stick, to the right and back, then the right one likewise.
    """

    def pressed(button: int) -> bool:
        return button < len(buttons) and bool(buttons[button])

    def deflection(axis: int) -> float:
        value = float(axes[axis]) if axis < len(axes) else 0.0
        return -max(-1.0, min(1.0, value)) if abs(value) > _DEAD else 0.0

    return Pad(
        lift=(pressed(_LEFT_SHOULDER), pressed(_RIGHT_SHOULDER)),
        move=(deflection(1), deflection(0)),
        second=(deflection(3), deflection(2)),
        turn=deflection(2),
        upright=pressed(_A),
    )


class HostGamepad:
    """Reads the first gamepad in a thread of its own, sixty times a second.

    Args:
        inputs: where what it says goes. A gamepad that is pulled out says nothing any more.

    Raises:
        MissingExtraError: the package pygame is not installed.
        NoGamepadError: no gamepad is there.
    """

    def __init__(self, inputs: OperatorInputs) -> None:
        # Without these SDL wants a screen, and pygame greets on the terminal.
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            import pygame
        except ModuleNotFoundError as error:
            raise MissingExtraError("pygame", "teleop", "A gamepad") from error
        self._pygame: Any = pygame
        pygame.display.init()
        pygame.joystick.init()
        if pygame.joystick.get_count() == 0:
            raise NoGamepadError(
                "no gamepad on this machine",
                wanted="one that is plugged in; one at the computer of the browser works through "
                "the page, with --device browser",
            )
        self._stick: Any = pygame.joystick.Joystick(0)
        self.name = str(self._stick.get_name())
        self._inputs, self._stop = inputs, threading.Event()
        self._thread = threading.Thread(target=self._run, name="poise gamepad", daemon=True)

    def start(self) -> None:
        """Starts reading."""
        self._thread.start()

    def stop(self) -> None:
        """Ends reading."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        stick = self._stick
        while not self._stop.wait(_PERIOD):
            self._pygame.event.pump()
            if not stick.get_init() or self._pygame.joystick.get_count() == 0:
                continue
            buttons = [stick.get_button(i) for i in range(stick.get_numbuttons())]
            axes = [stick.get_axis(i) for i in range(stick.get_numaxes())]
            self._inputs.pad(pad_from(buttons, axes))
