"""`Pursuit`: follows a device no faster than may be. `DeviceRate`: how fast it says that it moves.

`is_point`: whether what it says is a place.
"""

import math
from typing import TypeGuard

import numpy as np
from jaxtyping import Float64


def is_point(value: object) -> TypeGuard[np.ndarray]:
    """Whether a value is a place: a device may send anything."""
    return (
        isinstance(value, np.ndarray)
        and value.shape == (3,)
        and value.dtype == np.float64
        and all(map(math.isfinite, value.tolist()))
    )


class Pursuit:
    """Follows a place by no more than `start` + `step` n in any n ticks.

    Args:
        step: how far in a tick, on average [m].
        start: how far at once, after rest [m].
    """

    def __init__(self, step: float, start: float) -> None:
        self._step, self._start = step, start
        self._left = start  # Of the way that may be gone now [m].

    def follow(self, place: list[float], goal: list[float]) -> list[float]:
        """Where it is after a tick [m].

        Args:
            place: where it is now [m].
            goal: where it is led to [m].
        """
        part = self.part(math.dist(goal, place))
        if part == 1.0:
            return goal
        return [p + part * (g - p) for p, g in zip(place, goal, strict=True)]

    def part(self, away: float) -> float:
        """Which part of a way of so much is gone in a tick, which counts.

        Args:
            away: length of the way, in the unit of `step`.
        """
        most = self._left = min(self._left + self._step, self._start)
        if away <= most:
            self._left -= away
            return 1.0
        self._left = 0.0
        return most / away


_RATE_HOLDS = 0.1
"""For how long a velocity counts that is not told anew [s]."""

_FORGETS, _APART = 0.2, 0.05
"""Within which time and by how much the way that is said, and that which the device has gone, may
differ [s, m]. A device that reads its velocity late is apart by its speed times that time."""


class DeviceRate:
    """How fast a device says that it moves, for a moment from when it does.

    It counts for as long as the device goes the way that it says: one whose velocity has other axes
    or another scale than its place, or that stays where it is, would lead what follows it away from
    where it is itself, and beyond where that may go.

    Args:
        fastest: no hand is faster: such a velocity is none [m/s].
    """

    def __init__(self, fastest: float) -> None:
        self._fastest = fastest
        self._rate: Float64[np.ndarray, "3"] | None = None
        self._told_at = -math.inf
        self._said: list[float] = [0.0] * 3
        self._place: list[float] = [0.0] * 3
        self._apart: list[float] = [0.0] * 3

    def tell(self, rate: object, place: list[float], time: float) -> None:
        """Takes what came with a good sample.

        Args:
            rate: anything [m/s]; None where the device does not say.
            place: where the device is [m].
            time: of the robot [s].
        """
        self._rate = None
        if not (is_point(rate) and math.hypot(*rate.tolist()) <= self._fastest):
            return
        said, since = rate.tolist(), time - self._told_at
        if 0.0 <= since <= _RATE_HOLDS:
            left = 1.0 - since / _FORGETS
            self._apart = [
                left * (apart + 0.5 * since * (old + new) - (now - before))
                for apart, old, new, now, before in zip(
                    self._apart, self._said, said, place, self._place, strict=True
                )
            ]
        else:
            self._apart = [0.0] * 3
        self._said, self._place, self._told_at = said, place, time
        if math.hypot(*self._apart) <= _APART:
            # A copy: devices write over what they have given.
            self._rate = np.array(rate)

    def at(self, time: float) -> Float64[np.ndarray, "3"] | None:
        """The velocity at a time of the robot [m/s]; None where nothing is known."""
        return self._rate if 0.0 <= time - self._told_at <= _RATE_HOLDS else None
