"""`OperatorInputs`: the latest `Pad`, from a page, gamepad or program to the robot's loop.

`StageTimes`: when a message was where.
"""

import math
import threading
import time as clock
from collections import deque
from typing import NamedTuple, TypeVar

from msgspec.structs import replace

from poise.apps.live._pad import Head, Pad, Tracked, within_reach
from poise.locomotion import Lateness

FRESH_FOR = 0.4
"""The operator is there for so long after the last sign of life [s]."""

LATE = 0.5
"""What comes this much later than the soonest did is no sign of life [s]."""

_MOVES_FOR = 0.1
"""For how long a velocity counts that is not told anew [s]."""


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
    counts as let go until it really is. A message that another one has overtaken is no sign of
    life: where a clock has jumped back, there is a silence, and then it is the new one that counts.
    Nor is one that comes `LATE` later than the soonest did: whoever leads through a link that is
    choked leads a robot of half a second ago.
    A clutch that was open in a message is seen to be, also where a closed one overtook it: messages
    come in bursts, and a hand that let go, moved and took hold anew must not seem to have led.

    Attributes:
        stages: times of the last messages that the robot's loop took; the loop passes over those
            that newer ones overtook.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pad = Pad()
        self._alive_at: float | None = None
        self._lateness = Lateness()
        self._stale = Pad()
        self._unseen: Pad | None = None
        self.stages: deque[StageTimes] = deque(maxlen=_STAGES)
        self._unread: tuple[float, float] | None = None
        self._sampled: tuple[float, float, float] | None = None

    def pad(self, pad: Pad) -> dict[str, float]:
        """Takes the state of keys, sticks and handles: a sign of life.

        Returns:
            Nothing where it counts. Else "old", by how much a newer one came before it by their
            `beat`, or "late", by how much later than the soonest it came by it [s].
        """
        pad = within_reach(pad)
        with self._lock:
            alive, now = self._alive, clock.monotonic()
            if alive and 0.0 < pad.beat < self._pad.beat:
                return {"old": 1e-3 * (self._pad.beat - pad.beat)}
            if not alive:
                self._lateness.restart()
                # Who has only just come may press keys at once; a handle has a place, which is an
                # old one until it is let go.
                silent = self._alive_at is not None
                self._stale = pad if silent else _held_somewhere(pad)
            late = self._lateness.of(1e-3 * pad.beat, now) if pad.beat > 0.0 else 0.0
            if late > LATE:
                return {"late": late}
            self._stale = _still_held(self._stale, pad)
            fresh = _without(pad, self._stale)
            self._unseen = fresh if self._unseen is None else _reopened(fresh, self._unseen)
            self._pad, self._alive_at = fresh, now
            self._unread = (1e-3 * pad.beat, self._alive_at)
            return {}

    def clear(self) -> None:
        """Nobody is at the controls; whoever comes back is as after a silence."""
        with self._lock:
            self._pad, self._unseen = Pad(), None
            self._alive_at = None if self._alive_at is None else -math.inf

    def read(self) -> Pad | None:
        """What the operator does; None when there has been no sign of life for a while."""
        with self._lock:
            if self._unread is not None:
                self._sampled, self._unread = (*self._unread, clock.monotonic()), None
            pad, self._unseen = self._pad if self._unseen is None else self._unseen, None
            if not self._alive:
                return None
            # The loop reads the last message again in each tick: what stood still meanwhile rests.
            return (
                pad if clock.monotonic() - (self._alive_at or 0.0) <= _MOVES_FOR else _resting(pad)
            )

    @property
    def alive(self) -> bool:
        """Whether there has been a sign of life lately."""
        with self._lock:
            return self._alive

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


_Clutched = TypeVar("_Clutched", Tracked, Head)


def _resting(pad: Pad) -> Pad:
    """A message without velocities."""
    if not any(each is not None and each.velocity for each in (*pad.tracked, *pad.hands)):
        return pad
    tracked, hands = ((_at_rest(left), _at_rest(right)) for left, right in (pad.tracked, pad.hands))
    return replace(pad, tracked=tracked, hands=hands)


def _at_rest(tracked: Tracked | None) -> Tracked | None:
    return None if tracked is None else replace(tracked, velocity=None)


def _held_somewhere(pad: Pad) -> Pad:
    """What of a message has a place."""
    return Pad(drag=pad.drag, tracked=pad.tracked, hands=pad.hands, head=pad.head)


def _still_held(stale: Pad, pad: Pad) -> Pad:
    """What of a stale message has not been let go since."""
    return Pad(
        lift=(stale.lift[0] and pad.lift[0], stale.lift[1] and pad.lift[1]),
        move=pad.move if any(stale.move) else (0.0, 0.0),
        second=pad.second if any(stale.second) else (0.0, 0.0),
        turn=pad.turn if stale.turn else 0.0,
        drag=(
            None if stale.drag[0] is None else pad.drag[0],
            None if stale.drag[1] is None else pad.drag[1],
        ),
        tracked=(
            _still_closed(stale.tracked[0], pad.tracked[0]),
            _still_closed(stale.tracked[1], pad.tracked[1]),
        ),
        hands=(
            _still_closed(stale.hands[0], pad.hands[0]),
            _still_closed(stale.hands[1], pad.hands[1]),
        ),
        head=_still_closed(stale.head, pad.head),
    )


def _still_closed(stale: _Clutched | None, tracked: _Clutched | None) -> _Clutched | None:
    """A clutch that was closed is so until it is seen open: out of sight is not let go."""
    if stale is None or not stale.clutch:
        return None
    return tracked if tracked is not None else stale


def _reopened(pad: Pad, unseen: Pad) -> Pad:
    """A message with the clutches that were open in what nobody has seen yet."""
    if unseen.tracked == unseen.hands == (None, None) and unseen.head is None:
        return pad
    return replace(
        pad,
        tracked=(
            unseen.tracked[0] if _is_open(unseen.tracked[0]) else pad.tracked[0],
            unseen.tracked[1] if _is_open(unseen.tracked[1]) else pad.tracked[1],
        ),
        hands=(
            unseen.hands[0] if _is_open(unseen.hands[0]) else pad.hands[0],
            unseen.hands[1] if _is_open(unseen.hands[1]) else pad.hands[1],
        ),
        head=unseen.head if _is_open(unseen.head) else pad.head,
    )


def _without(pad: Pad, stale: Pad) -> Pad:
    """A message without what is stale in it."""
    if stale == Pad():
        return pad
    return replace(
        pad,
        lift=(pad.lift[0] and not stale.lift[0], pad.lift[1] and not stale.lift[1]),
        move=(0.0, 0.0) if any(stale.move) else pad.move,
        second=(0.0, 0.0) if any(stale.second) else pad.second,
        turn=0.0 if stale.turn else pad.turn,
        drag=(
            pad.drag[0] if stale.drag[0] is None else None,
            pad.drag[1] if stale.drag[1] is None else None,
        ),
        tracked=(
            pad.tracked[0] if not _is_closed(stale.tracked[0]) else None,
            pad.tracked[1] if not _is_closed(stale.tracked[1]) else None,
        ),
        hands=(
            pad.hands[0] if not _is_closed(stale.hands[0]) else None,
            pad.hands[1] if not _is_closed(stale.hands[1]) else None,
        ),
        head=pad.head if not _is_closed(stale.head) else None,
    )


def _is_closed(tracked: Tracked | Head | None) -> bool:
    return tracked is not None and tracked.clutch


def _is_open(tracked: Tracked | Head | None) -> bool:
    return tracked is not None and not tracked.clutch
