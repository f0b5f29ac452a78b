"""`LiveHands`: the operator's wishes as two hands that move smoothly, a `Device`.

`OperatorInputs`: what the operator does right now, handed from a page or gamepad to the loop.
"""

import threading
import time as clock
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from poise.locomotion import DeviceSample, StepTeleoperator

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


HOLD_HEIGHT = 0.10
"""A foot that is lifted by a button is held this far above its place on the ground [m]."""

_SPEED = 0.6
"""A hand follows its handle no faster than this [m/s], however the mouse jumps."""
_DOWN_SPEED = 0.15
"""A foot that is let go comes down at this speed [m/s]."""
_STICK_SPEED = 0.25
"""Speed of a lifted foot with the stick all the way over [m/s]."""
_STICK_LEAD = 0.06
"""The stick moves a hand no further than this ahead of its foot, along an axis [m]."""


class LiveHands:
    """Two hands for the feet of a robot.

    A foot is held by dragging its handle, or by a button, and then moved by the stick. A foot that
    is let go comes down where it is. With both feet on the ground a hand that holds nothing is on
    its foot: the handle snaps back after landing.

    Args:
        inputs: what the operator does.
        controller: knows where the feet are.

    Attributes:
        offset: from the world that the controller estimates to the drawn one, x, y, z [m].
        places: where the hands are, left and right, in the controller's world [m].
    """

    def __init__(self, inputs: OperatorInputs, controller: StepTeleoperator) -> None:
        self._inputs, self._controller = inputs, controller
        self._dt = controller.parameters.dt
        self.offset: Float64[np.ndarray, "3"] = np.zeros(3)
        self.places = [anchor.copy() for anchor in controller.estimator.anchors]

    def sample(self, time: float) -> DeviceSample | None:
        """Where the hands are.

        Args:
            time: of the robot [s].

        Returns:
            None while nobody is at the controls.
        """
        wish = self._inputs.read()
        if wish is None:
            return None
        for foot in (0, 1):
            goal, down = self._goal(foot, wish.drag[foot], wish.pad)
            way = goal - self.places[foot]
            most = self._dt * _SPEED
            step = np.clip(way, -most, most)
            if down:
                step[2] = max(step[2], -self._dt * _DOWN_SPEED)
            self.places[foot] = self.places[foot] + step
        left, right = (place.copy() for place in self.places)
        return DeviceSample(time, left, right, wish.pad.upright)

    def _goal(
        self, foot: int, drag: Float64[np.ndarray, "3"] | None, pad: Pad
    ) -> tuple[Float64[np.ndarray, "3"], bool]:
        """Where a hand goes [m], and whether it does so because it was let go."""
        estimator, place = self._controller.estimator, self.places[foot]
        anchor = estimator.anchors[foot]
        if drag is not None:
            return drag - self.offset, False
        mode = self._controller.mode
        in_air = mode.single and mode.support != foot
        if pad.lift[foot]:
            height = anchor[2] + HOLD_HEIGHT
            if not in_air:
                return np.array([anchor[0], anchor[1], height]), False
            foot_at = estimator.sole(foot)[:2]
            moved = place[:2] + self._dt * _STICK_SPEED * np.array(pad.move)
            moved = np.clip(moved, foot_at - _STICK_LEAD, foot_at + _STICK_LEAD)
            return np.array([*moved, height]), False
        if in_air:
            x, y = estimator.sole(foot)[:2]
            lowest = anchor[2] - self._controller.parameters.press_depth
            return np.array([x, y, lowest]), True
        return anchor, False
