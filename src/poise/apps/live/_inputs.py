"""`OperatorInputs`: the newest sample, from a page, gamepad or program to the robot's loop."""

import threading
import time as clock
from collections import deque
from typing import NamedTuple

from msgspec.structs import replace

from poise.apps.live._paced import DRIVES
from poise.locomotion import LATE, SILENT_AFTER, OperatorSample, SampleClock, TrackedPose


class StageTimes(NamedTuple):
    """Times of an operator's message, from the device to the command."""

    sent: float  # by the sender's clock, `OperatorSample.time` [s]
    arrived: float  # here [s]
    sampled: float  # by the robot's loop, in the tick that it is for [s]
    commanded: float  # the robot had the command that follows from it [s]


_REST = OperatorSample()
# Buttons and sticks of a sample
_LEVERS = ("lift", "grip", "move", "second", "turn", "velocity", "bend", "reach", "neutral")
Lever = tuple[str, int]  # something that is held: its name, and of parts their number


class _Message(NamedTuple):
    sample: OperatorSample
    held: set[Lever]
    arrived: float


class OperatorInputs:
    """The newest sample; written from any thread, read by the loop."""

    def __init__(self) -> None:
        self._lock, self._clock = threading.Lock(), SampleClock()
        self._came, self._stale = False, set[Lever]()
        self._newest: _Message | None = None
        # No more than are read of a connection in one look.
        self._unread: deque[_Message] = deque(maxlen=DRIVES.burst)
        # Five minutes of them at the page's rate.
        self.stages: deque[StageTimes] = deque(maxlen=10_000)
        self._sampled: tuple[float, float, float] | None = None

    def take(self, sample: OperatorSample) -> dict[str, float | bool]:
        """Take a sample; return why it does not count [s], or `again`: release the levers first."""
        with self._lock:
            now, stamp = clock.monotonic(), sample.time
            lost = self._clock.is_lost(now)
            if stamp > 0.0 and not self._clock.accepts(stamp, now):
                # By how much it is older than the newest, ahead of the time, or late [s].
                ahead = stamp - self._clock.newest
                early = ahead - (now - self._clock.heard_at)
                if ahead <= 0.0:
                    return {"old": -ahead}
                late = {"late": self._clock.lateness(stamp, now)}
                return {"early": early} if early > LATE else late
            self._clock.heard_at = now
            parts = _parts(sample)
            held = _held(sample, parts)
            if lost:
                # Who has only just come may press keys already; a part has a place, which is an old
                # one until it is let go.
                self._stale = {e for e in held if self._came or e[0] in ("handle", "clutch")}
                self._came = True
            # Out of sight is not let go.
            self._stale &= held | {("clutch", i) for i, part in enumerate(parts) if part is None}
            if self._unread and self._unread[-1].held == held:
                self._unread.pop()
            self._unread.append(_Message(_without(sample, parts, self._stale), held, now))
            return {"again": True} if self._stale & held else {}

    def clear(self) -> None:
        """Discard the operator's state, as after a silence."""
        with self._lock:
            self._clock.reset()
            self._unread.clear()
            self._newest = None

    def heard(self) -> float | None:
        """Return the time of the newest sample [s]; None before the first."""
        with self._lock:
            return None if self._newest is None else self._newest.arrived

    def read(self) -> OperatorSample | None:
        """Return the newest sample; None where it is older than a device's period."""
        with self._lock:
            now, message = clock.monotonic(), self._newest
            if self._clock.is_lost(now):
                return None
            if self._unread:
                message = self._newest = self._unread.popleft()
                self._sampled = (message.sample.time, message.arrived, now)
            elif message is None or now - message.arrived > SILENT_AFTER:
                return None
            return message.sample

    def commanded(self, at: float) -> None:
        """Record that the command computed from the last sample has been sent."""
        with self._lock:
            if self._sampled is not None:
                self.stages.append(StageTimes(*self._sampled, at))
                self._sampled = None


def _parts(sample: OperatorSample) -> list[TrackedPose | None]:
    """Feet, hands and head; None for a foot or hand without a place."""
    limbs = (*sample.feet, *sample.hands)
    return [*(p if p is not None and p.position else None for p in limbs), sample.head]


def _held(sample: OperatorSample, parts: list[TrackedPose | None]) -> set[Lever]:
    """All that is held in a sample."""
    held = {(name, 0) for name in _LEVERS if getattr(sample, name) != getattr(_REST, name)}
    held |= {("clutch", i) for i, part in enumerate(parts) if part is not None and part.clutch}
    feet = enumerate(parts[:2])
    return held | {("handle", i) for i, foot in feet if foot is not None and foot.clutch is None}


def _without(
    sample: OperatorSample, parts: list[TrackedPose | None], stale: set[Lever]
) -> OperatorSample:
    """Copy a sample with these parts, in which stale levers are let go."""
    numbers = {i for name, i in stale if name in ("handle", "clutch")}
    left, right, left_hand, right_hand, head = (
        None if i in numbers else part for i, part in enumerate(parts)
    )
    rest = {name: getattr(_REST, name) for name, _ in stale if name in _LEVERS}
    return replace(sample, feet=(left, right), hands=(left_hand, right_hand), head=head, **rest)
