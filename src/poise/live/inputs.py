"""`OperatorInputs`: what the operator does right now, handed from a page or gamepad to the loop."""

import threading
import time as clock
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

FRESH_FOR = 0.4
"""The operator is there for so long after the last sign of life [s]."""

_SMOOTH = 0.2
"""How much a new time between two signs of life counts."""


@dataclass(frozen=True, slots=True)
class Pad:
    """Keys, held buttons or a gamepad.

    Attributes:
        lift: whether the left and the right foot shall be up.
        move: where the lifted foot goes, forward and left, each from -1 to 1.
        upright: whether the torso shall be brought upright.
    """

    lift: tuple[bool, bool] = (False, False)
    move: tuple[float, float] = (0.0, 0.0)
    upright: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Wish:
    """What the operator wants.

    Attributes:
        pad: keys, buttons, sticks.
        drag: where the left and the right foot's handle is held, in the drawn world; None for one
            that is not held [m].
    """

    pad: Pad = Pad()
    drag: tuple[Float64[np.ndarray, "3"] | None, Float64[np.ndarray, "3"] | None] = (None, None)


class OperatorInputs:
    """The latest of everything; written from any thread, read by the loop."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._wish = Wish()
        self._alive_at: float | None = None
        self.gap = 0.0
        """Time from one sign of life to the next, smoothed [s]."""

    def pad(self, pad: Pad) -> None:
        """Takes the state of keys and sticks: a sign of life."""
        with self._lock:
            now = clock.monotonic()
            if self._alive_at is not None:
                self.gap += _SMOOTH * (now - self._alive_at - self.gap)
            self._wish, self._alive_at = replace(self._wish, pad=pad), now

    def drag(self, foot: int, place: Float64[np.ndarray, "3"] | None) -> None:
        """A handle is held at a place of the drawn world [m], or let go.

        Args:
            foot: 0 left, 1 right.
            place: None when it is let go.
        """
        with self._lock:
            left, right = self._wish.drag
            self._wish = replace(self._wish, drag=(place, right) if foot == 0 else (left, place))

    def clear(self) -> None:
        """Nobody is at the controls."""
        with self._lock:
            self._wish, self._alive_at = Wish(), None

    def read(self) -> Wish | None:
        """What the operator wants; None when there has been no sign of life for a while."""
        with self._lock:
            if self._alive_at is None or clock.monotonic() - self._alive_at > FRESH_FOR:
                # Hands that come back have to take hold again.
                self._wish = Wish()
                return None
            return self._wish
