"""`TurnRate`: how fast something is turned to where it shall be.

`is_stuck`, `TurnProgress`: whether it is turned as far as it goes, at once and on average.
`TurnShare`: how much an arm does for turning its hand, whose place comes first. `stopping`:
velocities from which joints still stop at their limits.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.dynamics import rotation_vector

BRAKING, SPEED_RATIO = 0.6, 0.7
"""Parts of the largest acceleration that is counted on near a goal, and of velocity limits."""

ARRIVED = 1e-3
"""Joints no farther from rest than this, and no faster, are at rest [rad, rad/s]."""

_LEAST_SPEED, _LOST = 0.1, 0.5
"""What is to turn faster than this [rad/s], and loses more than this part of what it is to gain in
a tick, is turned as far as it goes."""


_AVERAGED, _HARDLY = 0.2, 0.15
"""An arm at its limits is not still: over how long its turning is averaged [s], and the part of the
wanted angular velocity below which it hardly turns its hand."""

_SHORT, _GOES_ON = 0.03, 0.5
"""A hand is short of its place that is to go there faster than this [m/s], and goes on if it comes
nearer at this part of that at least."""

_PATIENCE, _OUT, _IN = 0.2, 0.2, 1.0
"""How long a hand that is short may get no nearer: as long as it takes to set out; how long turning
takes to fade out then, and in again [s]."""


@dataclass(frozen=True, kw_only=True)
class TurnRate:
    """Angular velocities towards a goal.

    Attributes:
        gain: speed over angle [1/s].
        speed: largest [rad/s].
        acceleration: largest [rad/s^2].
        dt: length of a tick [s].
    """

    gain: float
    speed: float
    acceleration: float
    dt: float

    def towards(
        self, goal: Float64[np.ndarray, "3 3"], actual: Float64[np.ndarray, "3 3"]
    ) -> Float64[np.ndarray, "3"]:
        """The angular velocity that is to be: no faster than it can be braked [rad/s].

        Args:
            goal: how it shall be turned.
            actual: how it is.
        """
        way = rotation_vector(goal, actual)
        far = math.hypot(*way)
        braked = math.sqrt(2.0 * BRAKING * self.acceleration * far)
        return way * (min(self.gain * far, braked, self.speed) / max(far, 1e-9))

    def change(
        self, wanted: Float64[np.ndarray, "3"], before: Float64[np.ndarray, "3"]
    ) -> Float64[np.ndarray, "3"]:
        """The angular velocity of this tick [rad/s].

        Args:
            wanted: what is to be in the end [rad/s].
            before: what is [rad/s].
        """
        change = wanted - before
        most = self.acceleration * self.dt
        return before + change * min(1.0, most / max(math.hypot(*change), 1e-12))


def is_stuck(
    wanted: Float64[np.ndarray, "3"],
    asked: Float64[np.ndarray, "3"],
    found: Float64[np.ndarray, "3"],
) -> bool:
    """Whether something is turned as far as it goes.

    Args:
        wanted: angular velocity that is to be in the end [rad/s].
        asked: in this tick [rad/s].
        found: what the joints do of that [rad/s].
    """
    speed = math.hypot(*wanted)
    along = float(wanted @ asked)
    return speed > _LEAST_SPEED and along > 0.0 and float(wanted @ found) < (1.0 - _LOST) * along


class TurnProgress:
    """Whether a hand is turned as far as it goes: on average it hardly turns to where it shall.

    Args:
        dt: length of a tick [s].

    Attributes:
        stuck: whether it is.
    """

    def __init__(self, dt: float) -> None:
        self._dt, self._part, self.stuck = dt, 1.0, False

    def update(self, wanted: Float64[np.ndarray, "3"], now: Float64[np.ndarray, "3"]) -> None:
        """One tick.

        Args:
            wanted: angular velocity that is to be in the end [rad/s].
            now: what is [rad/s].
        """
        speed, part = math.hypot(*wanted), 1.0
        if speed > _LEAST_SPEED:
            along = min(max(float(wanted @ now) / speed**2, -1.0), 1.0)
            part = self._part + (along - self._part) * self._dt / _AVERAGED
        self._part, self.stuck = part, part < _HARDLY


class TurnShare:
    """How much an arm does for turning its hand, whose place comes first.

    What turns a hand moves it nowhere at once; but an arm that it has bent comes to its limits
    elsewhere. So where the hand is short of its place and gets no nearer, turning fades out, and in
    again when the hand goes on.

    Args:
        dt: length of a tick [s].

    Attributes:
        part: from 0 to 1.
    """

    def __init__(self, dt: float) -> None:
        self._dt, self._stalled, self.part = dt, 0.0, 1.0

    def update(self, speed: float, nearer: float) -> None:
        """One tick.

        Args:
            speed: at which the hand is to go to its place [m/s].
            nearer: at which it comes nearer [m/s].
        """
        if speed < _SHORT or nearer > _GOES_ON * speed:
            self._stalled, change = 0.0, self._dt / _IN
        else:
            self._stalled += self._dt
            change = -self._dt / _OUT if self._stalled > _PATIENCE else 0.0
        self.part = min(max(self.part + change, 0.0), 1.0)


def stopping(room: Float64[np.ndarray, " k"], stop: float, dt: float) -> Float64[np.ndarray, " k"]:
    """The velocities that come to rest in so much room, which may be rounded below zero [rad/s].

    Args:
        room: up to a limit [rad].
        stop: acceleration that they stop with [rad/s^2].
        dt: length of a tick [s].
    """
    room = np.maximum(room, 0.0)
    return np.minimum(np.sqrt(2.0 * stop * room), 0.5 * room / dt)
