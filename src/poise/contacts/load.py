"""`LoadRamp`: how much of its load a contact may carry, over time."""

import math

_ROUNDING = 1e-9
"""Load left that is the sum's rounding, not a tick's share of the ramp."""


class LoadRamp:
    """A number between zero and one that moves linearly to a goal.

    The ramp starts at the first `advance` after `start`, so that whoever starts it needs no clock,
    and it counts time forwards only: a clock that jumps back does not stop it.
    """

    def __init__(self) -> None:
        self._load = 1.0
        self._goal = 1.0
        self._rate = math.inf
        self._time: float | None = None

    @property
    def active(self) -> bool:
        """Whether any load may be carried now, or will be at the end of the ramp."""
        return self._load > 0.0 or self._goal > 0.0

    def start(self, goal: float, duration: float) -> None:
        """Moves to a goal over a duration [s], from wherever the load is now."""
        self._goal = goal
        self._rate = abs(goal - self._load) / duration if duration > 0.0 else math.inf
        self._time = None

    def advance(self, time: float) -> float:
        """The load at a time [s]."""
        if self._load == self._goal:
            return self._load
        elapsed = 0.0 if self._time is None else max(time - self._time, 0.0)
        self._time = time
        left = self._goal - self._load
        if math.isinf(self._rate) or self._rate * elapsed >= abs(left) - _ROUNDING:
            self._load = self._goal
        else:
            self._load += math.copysign(self._rate * elapsed, left)
        return self._load
