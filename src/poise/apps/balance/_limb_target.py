"""`LimbTarget`: the newest target of a limb, interpolated from message to message."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise.locomotion import SILENT_AFTER, Goal

HELD_FOR = 5.0
"""Time for which a limb without targets holds, as long as a silent operator's seat is kept [s]."""

_SHORTEST = 1e-3
"""Interval of a client at the rate of motor drives, 1 kHz; stamps may be closer, or go back [s]."""


class _Segment(NamedTuple):
    """Line from one target to the next."""

    start: Float64[np.ndarray, " n"]
    end: Float64[np.ndarray, " n"]
    rotation: Float64[np.ndarray, "3 3"] | None
    by_joints: bool
    begin: float  # [s]
    duration: float  # [s]


class LimbTarget:
    """Joint positions or a pose, reached one interval of the messages after they came.

    Between two messages the target moves from x_0, where it was, to x_1 with a constant velocity,

        x(t) = x_0 + (x_1 - x_0) min(1, (t - t_1) / T)

    so that a staircase of any rate becomes continuous, and a client that stops leaves it at its
    last target. The first one, one after a silence, and one of another kind begins where it is.
    """

    def __init__(self) -> None:
        self._segment: _Segment | None = None
        self._stamp = 0.0

    def take(
        self,
        target: Float64[np.ndarray, " n"],
        stamp: float,
        time: float,
        *,
        rotation: Float64[np.ndarray, "3 3"] | None = None,
        by_joints: bool,
    ) -> None:
        """Take a target with its stamp on the client's clock, which came at a time [s]."""
        before, start = self._segment, target
        if before is not None and before.by_joints is by_joints and self.goal(time) is not None:
            start = self._place(before, time)
        # No device that is followed without gaps has a longer period.
        duration = min(max(stamp - self._stamp, _SHORTEST), SILENT_AFTER)
        self._stamp = stamp
        self._segment = _Segment(start, target, rotation, by_joints, time, duration)

    def last(self) -> Float64[np.ndarray, " n"] | None:
        """Return the last joint positions; None without any."""
        found = self._segment
        return None if found is None or not found.by_joints else found.end

    def goal(self, time: float) -> Goal | None:
        """Return the goal at a time [s]; None where the limb goes to rest."""
        found = self._segment
        if found is None or abs(time - found.begin) > HELD_FOR:
            return None
        place, rate = self._place(found, time), None
        if time - found.begin < found.duration:
            rate = (found.end - found.start) / found.duration
        if found.by_joints:
            return Goal(joints=place, rate=rate)
        return Goal(place, found.rotation, rate)

    @staticmethod
    def _place(segment: _Segment, time: float) -> Float64[np.ndarray, " n"]:
        part = min(max((time - segment.begin) / segment.duration, 0.0), 1.0)
        return segment.start + part * (segment.end - segment.start)
