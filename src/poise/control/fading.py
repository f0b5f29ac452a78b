"""`Fading`: how much of the last good command is left, whatever the clock does."""

import math

_MIN_TICK = 1e-3
"""Least time that a tick without an answer counts, so that a clock that stands still, jumps back or
is not a number does not hold the last command for ever [s]."""


class Fading:
    """A share that falls from one as exp(-t / decay time) since the last good command.

    Args:
        decay_time: time constant [s].
    """

    def __init__(self, decay_time: float) -> None:
        self._decay_time = decay_time
        self._time = 0.0
        self._ticks = 0

    def restart(self, time: float) -> None:
        """A good command was given, at a time [s]."""
        self._time = time
        self._ticks = 0

    def tick(self, time: object) -> float:
        """The share that is left; each call counts as a tick.

        Args:
            time: time of the state [s]; where it is of no use a millisecond a tick is counted.
        """
        self._ticks += 1
        elapsed = self._ticks * _MIN_TICK
        if isinstance(time, float | int) and math.isfinite(time):
            elapsed = max(elapsed, time - self._time)
        return math.exp(-elapsed / self._decay_time)
