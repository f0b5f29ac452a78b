"""`TrackedFeet`: two trackers, each of which leads a foot by how it moves: a `Device`.

`FootClutch`: from when until when a tracker leads, and where to.
`rest_place`: where a device is that leads nothing. `along_ahead`: what is ahead, in the world.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.locomotion._stepping._operator import (
    Clutch,
    DeviceSample,
    FaultLog,
    FieldError,
    HandSample,
    checked_tracker,
    is_point,
)
from poise.locomotion._stepping._step_teleoperator import StepTeleoperator

_SIDES = ("left", "right")
_STRAY = 0.3
"""A tracker that is further away from one message to the next is another thing [m]."""

Trackers = tuple[float, HandSample | None, HandSample | None]
"""A stamp of the trackers' clock [s], and what the left and the right one say; None for one that is
not there."""


class FootClutch:
    """Where a tracker leads its foot to: by how it moved since its clutch closed.

    The clutch has to be seen closing: one that is closed when its tracker is found, found again
    after half a second, or found elsewhere than it was lost, leads nothing until it was open. What
    is ahead for the tracker is so for the robot when it takes hold.

    Args:
        scale: way of the foot over way of the tracker.
    """

    def __init__(self, scale: float = 1.0) -> None:
        self._clutch, self._ahead = Clutch(), 0.0
        self._scale = checked_number(scale, "scale of the trackers' ways", above=0.0)
        self._offset: Float64[np.ndarray, "3"] = np.zeros(3)
        self._last: list[float] = [0.0] * 3

    def follow(
        self,
        tracker: HandSample | None,
        place: Float64[np.ndarray, "3"],
        ahead: float,
        time: float,
    ) -> Float64[np.ndarray, "3"] | None:
        """Takes what the tracker says.

        Args:
            tracker: where it is, forward, left and up for the operator [m]; None where it is gone.
            place: from where it leads its foot if it takes hold now, in the world [m].
            ahead: where the robot faces, to the left of the world's x axis [rad].
            time: of the robot [s].

        Returns:
            Where it leads its foot to, in the world [m]; None while it does not.
        """
        clutch = self._clutch
        clutch.expire(time)
        if tracker is None or not is_point(tracker.position):
            clutch.lose()
            return None
        if not tracker.clutch:
            clutch.open(time)
            return None
        point: list[float] = tracker.position.tolist()
        if clutch.takes_hold():
            self._ahead = ahead
            self._offset = place - self._way(point)
        elif not clutch.holds:
            return None
        elif math.dist(point, self._last) > _STRAY:
            clutch.lose()
            return None
        self._last = point
        clutch.good(time)
        return self._offset + self._way(point)

    def rate(self, tracker: HandSample | None) -> Float64[np.ndarray, "3"] | None:
        """How fast the place moves to which it leads [m/s]; None where the tracker does not say."""
        if not self._clutch.holds or tracker is None or not is_point(tracker.velocity):
            return None
        return self._way(tracker.velocity.tolist())

    def _way(self, forward_left_up: Sequence[float]) -> Float64[np.ndarray, "3"]:
        return self._scale * along_ahead(forward_left_up, self._ahead)


class TrackedFeet:
    """Two trackers as a `Device`: each leads its foot while its clutch is closed, see `FootClutch`.

    A foot that is let go comes down where it is.

    Args:
        teleoperator: whose feet are led.
        newest: says what has come since it was asked last; None for nothing. It is asked every
            tick, and must not wait.
        scale: way of a foot over way of its tracker.

    Attributes:
        errors: what in each tracker was no place or no velocity when it was asked last; None for
            nothing. A tracker without a place counts as gone, one without a velocity as one that
            does not say; the logger `poise` says so, each kind once.
    """

    def __init__(
        self,
        teleoperator: StepTeleoperator,
        newest: Callable[[], Trackers | None],
        *,
        scale: float = 1.0,
    ) -> None:
        self._teleoperator, self._newest = teleoperator, newest
        self._clutches = (FootClutch(scale), FootClutch(scale))
        self._places = [rest_place(teleoperator, foot) for foot in (0, 1)]
        self.errors: list[FieldError | None] = [None, None]
        self._faults = FaultLog()

    def sample(self, time: float) -> DeviceSample | None:
        """Where the trackers lead the feet.

        Args:
            time: of the robot [s].

        Returns:
            With the trackers' stamp; None where nothing new came.
        """
        came = self._newest()
        if came is None:
            return None
        teleoperator, places = self._teleoperator, self._places
        stamp, *said = came
        trackers = [self._checked(foot, each) for foot, each in zip((0, 1), said, strict=True)]
        for foot, (clutch, tracker) in enumerate(zip(self._clutches, trackers, strict=True)):
            led = clutch.follow(tracker, places[foot], teleoperator.ahead, time)
            places[foot] = rest_place(teleoperator, foot) if led is None else led
        left, right = (
            clutch.rate(tracker) for clutch, tracker in zip(self._clutches, trackers, strict=True)
        )
        return DeviceSample(stamp, places[0].copy(), places[1].copy(), rates=(left, right))

    def _checked(self, foot: int, said: object) -> HandSample | None:
        """What a tracker says, and what in it is left out."""
        tracker, error = checked_tracker(_SIDES[foot], said)
        self.errors[foot] = error
        if error is not None:
            self._faults.say(error, "part of what a tracker says is left out")
        return tracker


def rest_place(teleoperator: StepTeleoperator, foot: int) -> Float64[np.ndarray, "3"]:
    """Where a device is that leads nothing: on its foot, or straight below one in the air [m].

    So a foot that is let go comes down where it is.

    Args:
        teleoperator: whose foot.
        foot: 0 left, 1 right.
    """
    estimator, mode = teleoperator.estimator, teleoperator.mode
    place = estimator.anchors[foot].copy()
    if mode.single and mode.support != foot:
        place[:2] = estimator.sole(foot)[:2]
        place[2] -= teleoperator.parameters.press_depth
    return place


def along_ahead(vector: Sequence[float], ahead: float) -> Float64[np.ndarray, "3"]:
    """What is forward, left and up of a robot, along the world's axes.

    Args:
        vector: forward, left, up.
        ahead: where the robot faces, to the left of the world's x axis [rad].
    """
    (forward, left, up), c, s = vector, math.cos(ahead), math.sin(ahead)
    return np.array([c * forward - s * left, s * forward + c * left, up])
