"""`OperatorInputs`: the latest sample, from a page, gamepad or program to the robot's loop.

`StageTimes`: when a message was where.
"""

import math
import threading
import time as clock
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

from msgspec.structs import replace

from poise.locomotion import (
    LATE,
    LOST_AFTER,
    SILENT_AFTER,
    OperatorSample,
    SampleClock,
    TrackedPose,
)


class StageTimes(NamedTuple):
    """When a message of the operator's was where, on this machine's monotonic clock but for `sent`.

    Attributes:
        sent: by the sender's clock, `OperatorSample.time` [s].
        arrived: here [s].
        sampled: by the robot's loop, in the tick that it is for [s].
        commanded: the robot had the command that follows from it [s].
    """

    sent: float
    arrived: float
    sampled: float
    commanded: float


_STAGES = 10_000
"""Messages whose times are kept: those of half an hour at the page's rate in single ticks."""

Lever = tuple[str, int]
"""Something that is held: its name, and of which side or part."""


class OperatorInputs:
    """The latest of everything; written from any thread, read by the loop.

    Age and order are those of a `SampleClock` in wall-clock time, for the robot's may be slowed or
    stopped. What is held in the first message after a silence counts as let go until it really is.
    A clutch that was open in a message is read as open once, also where a closed one overtook it:
    messages come in bursts, and a hand that let go, moved and took hold anew must not seem to have
    moved the robot's.

    Attributes:
        stages: times of the last messages that the robot's loop took; the loop passes over those
            that newer ones overtook.
    """

    def __init__(self) -> None:
        self._lock, self._clock = threading.Lock(), SampleClock()
        self._sample = OperatorSample()
        self._alive_at: float | None = None
        self._stale = set[Lever]()
        self._opened = dict[int, TrackedPose]()
        self.stages: deque[StageTimes] = deque(maxlen=_STAGES)
        self._unread: tuple[float, float] | None = None
        self._sampled: tuple[float, float, float] | None = None

    def take(self, sample: OperatorSample) -> dict[str, float]:
        """Take the state of keys, sticks, handles and trackers: a sign of life.

        Returns:
            Nothing where it counts. Otherwise by how much it is older than the newest, "old",
            later than a link makes it, "late", or further ahead than time has passed, "early", by
            its `time` [s].
        """
        with self._lock:
            alive, now, stamp = self._alive, clock.monotonic(), sample.time
            if not alive:
                self._clock.reset()
            if stamp > 0.0 and not self._clock.accepts(stamp, now):
                return self._refusal(stamp, now)
            parts = _parts(sample)
            held = _held(sample, parts)
            if not alive:
                # Who has only just come may press keys already; a part has a place, which is an old
                # one until it is let go.
                new = self._alive_at is None
                self._stale = {e for e in held if not new or e[0] in ("handle", "clutch")}
            # Out of sight is not let go.
            unseen = {("clutch", index) for index, part in enumerate(parts) if part is None}
            self._stale &= held | unseen
            self._sample, self._alive_at = _without(sample, parts, self._stale), now
            self._opened |= {
                index: part
                for index, part in enumerate(parts)
                if part is not None and not part.clutch and not _is_handle(index, part)
            }
            self._unread = (stamp, now)
            return {}

    def clear(self) -> None:
        """Nobody is at the controls; whoever comes back is as after a silence."""
        with self._lock:
            self._sample = OperatorSample()
            self._opened.clear()
            self._alive_at = None if self._alive_at is None else -math.inf

    def read(self) -> OperatorSample | None:
        """Return what the operator does; None after a silence."""
        with self._lock:
            now = clock.monotonic()
            if self._unread is not None:
                self._sampled, self._unread = (*self._unread, now), None
            sample, opened = self._sample, self._opened
            if opened:
                parts = [opened.get(i, part) for i, part in enumerate(_parts(sample))]
                sample, self._opened = _with_parts(sample, parts), {}
            if not self._alive:
                return None
            # The loop reads the last message again in each tick: what stood still meanwhile rests.
            return sample if now - (self._alive_at or 0.0) <= SILENT_AFTER else _resting(sample)

    @property
    def alive(self) -> bool:
        """Whether there has been a sign of life lately."""
        with self._lock:
            return self._alive

    def commanded(self, at: float) -> None:
        """Note that the robot has a command that follows from what was read last.

        Args:
            at: when, on the monotonic clock [s].
        """
        with self._lock:
            if self._sampled is not None:
                self.stages.append(StageTimes(*self._sampled, at))
                self._sampled = None

    @property
    def _alive(self) -> bool:
        return self._alive_at is not None and clock.monotonic() - self._alive_at <= LOST_AFTER

    def _refusal(self, stamp: float, now: float) -> dict[str, float]:
        """Why a sample does not count, and by how much [s]."""
        ahead = stamp - self._clock.newest
        if ahead <= 0.0:
            return {"old": -ahead}
        early = ahead - (now - self._clock.heard_at)
        if early > LATE:
            return {"early": early}
        return {"late": self._clock.lateness(stamp, now)}


_STICKS: dict[str, Any] = {
    "move": (0.0, 0.0),
    "second": (0.0, 0.0),
    "turn": 0.0,
    "velocity": (0.0, 0.0, 0.0),
}
"""Sticks, and where they rest."""


def _parts(sample: OperatorSample) -> list[TrackedPose | None]:
    """Feet, hands and head; None for a foot or hand without a place."""
    limbs = (*sample.feet, *sample.hands)
    return [*(p if p is not None and p.position else None for p in limbs), sample.head]


def _with_parts(sample: OperatorSample, parts: Sequence[TrackedPose | None]) -> OperatorSample:
    left, right, left_hand, right_hand, head = parts
    return replace(sample, feet=(left, right), hands=(left_hand, right_hand), head=head)


def _is_handle(index: int, part: TrackedPose) -> bool:
    """A foot without a clutch; hands and heads without one are let go."""
    return part.clutch is None and index < 2


def _held(sample: OperatorSample, parts: Sequence[TrackedPose | None]) -> set[Lever]:
    """All that is held in a sample."""
    held: set[Lever] = {("lift", foot) for foot in (0, 1) if sample.lift[foot]}
    held |= {(name, 0) for name, rest in _STICKS.items() if getattr(sample, name) != rest}
    for index, part in enumerate(parts):
        if part is not None and (part.clutch or _is_handle(index, part)):
            held.add(("clutch" if part.clutch else "handle", index))
    return held


def _without(
    sample: OperatorSample, parts: list[TrackedPose | None], stale: set[Lever]
) -> OperatorSample:
    """A sample with these parts, in which stale levers are let go."""
    parts, (left, right) = list(parts), sample.lift
    for name, index in stale:
        if name in ("clutch", "handle"):
            parts[index] = None
    lift = (left and ("lift", 0) not in stale, right and ("lift", 1) not in stale)
    sticks = {name: rest for name, rest in _STICKS.items() if (name, 0) in stale}
    return _with_parts(replace(sample, lift=lift, **sticks), parts)


def _resting(sample: OperatorSample) -> OperatorSample:
    """A sample without velocities."""
    parts = [part and replace(part, velocity=None) for part in _parts(sample)]
    return _with_parts(sample, parts)
