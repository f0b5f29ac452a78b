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


class DeviceRate:
    """How fast a device says that it moves, for a moment from when it does.

    Args:
        fastest: no hand is faster: such a velocity is none [m/s].
    """

    def __init__(self, fastest: float) -> None:
        self._fastest = fastest
        self._rate: Float64[np.ndarray, "3"] | None = None
        self._told_at = -math.inf

    def tell(self, rate: object, time: float) -> None:
        """Takes what came with a good sample.

        Args:
            rate: anything [m/s]; None where the device does not say.
            time: of the robot [s].
        """
        good = is_point(rate) and math.hypot(*rate.tolist()) <= self._fastest
        # A copy: devices write over what they have given.
        self._rate, self._told_at = np.array(rate) if good else None, time

    def at(self, time: float) -> Float64[np.ndarray, "3"] | None:
        """The velocity at a time of the robot [m/s]; None where nothing is known."""
        return self._rate if 0.0 <= time - self._told_at <= _RATE_HOLDS else None
