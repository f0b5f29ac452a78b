"""`OperatorInputs`: what the operator does right now, handed from a page or gamepad to the loop.

`LiveFeet`: the same as two foot devices that move smoothly, a `Device`.
"""

import threading
import time as clock
from collections import deque
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float64
from msgspec import Meta, Struct
from msgspec.structs import replace

from poise.locomotion import DeviceSample, StepTeleoperator

FRESH_FOR = 0.4
"""The operator is there for so long after the last sign of life [s]."""

HOLD_HEIGHT = 0.10
"""A foot that is lifted by a button is held this far above its place on the ground [m]."""

_SPEED = 0.6
"""A device follows its handle no faster than this [m/s], however the mouse jumps."""
_DOWN_SPEED = 0.15
"""A foot that is let go comes down at this speed [m/s]."""
_STICK_SPEED = 0.25
"""Speed of a lifted foot with the stick all the way over [m/s]."""
_STICK_LEAD = 0.06
"""The stick moves a device no further than this ahead of its foot, along an axis [m]."""
_HANDLE_LEAD = 0.4
"""A handle is followed no further than this away from its foot, along an axis [m]: further than a
leg reaches, and near enough to be back within a second when the handle is."""

Deflection = Annotated[float, Meta(ge=-1.0, le=1.0)]
Coordinate = Annotated[float, Meta(gt=-100.0, lt=100.0)]
"""A handle further away than this [m] is none."""
Place = tuple[Coordinate, Coordinate, Coordinate]


class Pad(Struct, frozen=True, tag_field="do", tag="drive"):
    """Keys, held buttons, sticks and handles at one moment: the whole of what the operator does.

    A page says this as JSON, which is checked as it is read.

    Attributes:
        lift: whether the left and the right foot shall be up.
        move: where the lifted foot goes, or the robot that is driven, forward and left, each from
            -1 to 1.
        turn: where a robot that is driven turns, to the left, from -1 to 1.
        upright: whether the torso shall be brought upright.
        drag: where the left and the right foot's handle is held, in the drawn world; None for one
            that is not held [m].
        beat: the page's clock, which it gets back to measure the latency [ms].
    """

    lift: tuple[bool, bool] = (False, False)
    move: tuple[Deflection, Deflection] = (0.0, 0.0)
    turn: Deflection = 0.0
    upright: bool = False
    drag: tuple[Place | None, Place | None] = (None, None)
    beat: float = 0.0


class StageTimes(NamedTuple):
    """When a message of the operator's was where, on this machine's monotonic clock but for `sent`.

    Attributes:
        sent: by the sender's clock, `Pad.beat` [s].
        arrived: here [s].
        sampled: by the robot's loop, in the tick that it is for [s].
        commanded: the robot had the command that follows from it [s].
    """

    sent: float
    arrived: float
    sampled: float
    commanded: float


_STAGES = 10_000
"""How many messages' times are kept."""


class OperatorInputs:
    """The latest of everything; written from any thread, read by the loop.

    Whoever comes back after a silence takes hold anew: what was held in the first message after it
    counts as let go until it really is.

    Attributes:
        stages: times of the last messages that the robot's loop took; the loop passes over those
            that newer ones overtook.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pad = Pad()
        self._alive_at: float | None = None
        self._stale = Pad()
        self.stages: deque[StageTimes] = deque(maxlen=_STAGES)
        self._unread: tuple[float, float] | None = None
        self._sampled: tuple[float, float, float] | None = None

    def pad(self, pad: Pad) -> None:
        """Takes the state of keys, sticks and handles: a sign of life."""
        with self._lock:
            if not self._alive:
                # Who has only just come may press keys at once; a handle has a place, which is an
                # old one until it is let go.
                silent = self._alive_at is not None
                self._stale = pad if silent else Pad(drag=pad.drag)
            self._stale = _still_held(self._stale, pad)
            self._pad, self._alive_at = _without(pad, self._stale), clock.monotonic()
            self._unread = (1e-3 * pad.beat, self._alive_at)

    def clear(self) -> None:
        """Nobody is at the controls."""
        with self._lock:
            self._pad, self._alive_at = Pad(), None

    def read(self) -> Pad | None:
        """What the operator does; None when there has been no sign of life for a while."""
        with self._lock:
            if self._unread is not None:
                self._sampled, self._unread = (*self._unread, clock.monotonic()), None
            return self._pad if self._alive else None

    def commanded(self, at: float) -> None:
        """The robot has a command that follows from what was read last.

        Args:
            at: when, on the monotonic clock [s].
        """
        with self._lock:
            if self._sampled is not None:
                self.stages.append(StageTimes(*self._sampled, at))
                self._sampled = None

    @property
    def _alive(self) -> bool:
        return self._alive_at is not None and clock.monotonic() - self._alive_at <= FRESH_FOR


def _still_held(stale: Pad, pad: Pad) -> Pad:
    """What of a stale message has not been let go since."""
    return Pad(
        lift=(stale.lift[0] and pad.lift[0], stale.lift[1] and pad.lift[1]),
        move=pad.move if any(stale.move) else (0.0, 0.0),
        turn=pad.turn if stale.turn else 0.0,
        drag=(
            None if stale.drag[0] is None else pad.drag[0],
            None if stale.drag[1] is None else pad.drag[1],
        ),
    )


def _without(pad: Pad, stale: Pad) -> Pad:
    """A message without what is stale in it."""
    if stale == Pad():
        return pad
    return replace(
        pad,
        lift=(pad.lift[0] and not stale.lift[0], pad.lift[1] and not stale.lift[1]),
        move=(0.0, 0.0) if any(stale.move) else pad.move,
        turn=0.0 if stale.turn else pad.turn,
        drag=(
            pad.drag[0] if stale.drag[0] is None else None,
            pad.drag[1] if stale.drag[1] is None else None,
        ),
    )


class LiveFeet:
    """Two devices for the feet of a robot, left and right.

    A foot is held by dragging its handle, or by a button, and then moved by the stick. A foot that
    is let go comes down where it is. With both feet on the ground a device that holds nothing is on
    its foot: the handle snaps back after landing.

    Args:
        inputs: what the operator does.
        teleoperator: knows where the feet are.

    Attributes:
        offset: from the world that the teleoperator estimates to the drawn one, x, y, z [m].
        places: where the devices are, left and right, in the teleoperator's world [m].
    """

    def __init__(self, inputs: OperatorInputs, teleoperator: StepTeleoperator) -> None:
        self._inputs, self._teleoperator = inputs, teleoperator
        self._dt = teleoperator.parameters.dt
        self.offset: Float64[np.ndarray, "3"] = np.zeros(3)
        self.places = [anchor.copy() for anchor in teleoperator.estimator.anchors]

    def sample(self, time: float) -> DeviceSample | None:
        """Where the devices are.

        Args:
            time: of the robot [s].

        Returns:
            None while nobody is at the controls.
        """
        pad = self._inputs.read()
        if pad is None:
            # Whoever comes next finds the devices on the feet.
            self.places = [anchor.copy() for anchor in self._teleoperator.estimator.anchors]
            return None
        for foot in (0, 1):
            goal, down = self._goal(foot, pad)
            most = self._dt * _SPEED
            step = np.clip(goal - self.places[foot], -most, most)
            if down:
                step[2] = max(step[2], -self._dt * _DOWN_SPEED)
            self.places[foot] = self.places[foot] + step
        left, right = (place.copy() for place in self.places)
        return DeviceSample(time, left, right, pad.upright)

    def _goal(self, foot: int, pad: Pad) -> tuple[Float64[np.ndarray, "3"], bool]:
        """Where a device goes [m], and whether it does so because it was let go."""
        estimator, place = self._teleoperator.estimator, self.places[foot]
        anchor, drag = estimator.anchors[foot], pad.drag[foot]
        if drag is not None:
            sole = estimator.sole(foot)
            goal = np.array(drag) - self.offset
            return np.clip(goal, sole - _HANDLE_LEAD, sole + _HANDLE_LEAD), False
        mode = self._teleoperator.mode
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
            lowest = anchor[2] - self._teleoperator.parameters.press_depth
            return np.array([x, y, lowest]), True
        return anchor, False
