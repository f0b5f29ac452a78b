"""`Pad`: what the operator does at one moment, whatever they do it with.

`OperatorInputs`: the latest of it, handed from a page, gamepad or program to the robot's loop.
`StageTimes`: when a message was where.
"""

import math
import threading
import time as clock
from collections import deque
from typing import Annotated, NamedTuple, TypeVar

from msgspec import Meta, Struct
from msgspec.structs import replace

from poise.locomotion import Lateness

FRESH_FOR = 0.4
"""The operator is there for so long after the last sign of life [s]."""

LATE = 0.5
"""What comes this much later than the soonest did is no sign of life [s]."""

_MOVES_FOR = 0.1
"""For how long a velocity counts that is not told anew [s]."""

_NOWHERE = 100.0
"""What is so far away [m], or as fast [m/s], is no hand or foot: it is lost."""

Deflection = Annotated[float, Meta(ge=-1.0, le=1.0)]
Height = Annotated[float, Meta(gt=-100.0, lt=100.0)]
Place = tuple[float, float, float]
"""Any: what is beyond all reach does not cost the rest of its message."""

Far = Annotated[float, Meta(gt=-1e6, lt=1e6)]
"""A handle stands in the drawn world, in which a robot may walk far [m]."""
HandlePlace = tuple[Far, Far, Far]

Quaternion = tuple[float, float, float, float]
"""Of a rotation, (x, y, z, w); its length is checked by what follows it."""


class Tracked(Struct, frozen=True, forbid_unknown_fields=True):
    """Where a tracker sees a hand or foot of the operator that leads one of the robot's.

    Attributes:
        position: forward, left and up, from anywhere that stays where it is [m]. One that is 100 m
            away along an axis counts as lost.
        clutch: whether it leads. Only its motion while it does counts: whoever wants to reach
            further lets go, moves back, and takes hold anew.
        orientation: how it is turned against those axes, if the tracker says so. A foot is turned
            about the vertical alone, in place of what `Body` says of it.
        velocity: along those axes, if the tracker says so: what it leads lags less behind it [m/s].
            One of 100 m/s counts as lost.
    """

    position: Place
    clutch: bool = False
    orientation: Quaternion | None = None
    velocity: Place | None = None


class Head(Struct, frozen=True, forbid_unknown_fields=True):
    """Where the operator looks.

    Attributes:
        orientation: of the head against looking straight ahead, along forward, left and up.
        clutch: whether the robot looks there, too.
    """

    orientation: Quaternion
    clutch: bool = False


Turn = Annotated[float, Meta(ge=-3.2, le=3.2)]


class Body(Struct, frozen=True, forbid_unknown_fields=True):
    """What is asked for beside feet and hands; all zero asks for nothing.

    Attributes:
        height: of the COM, over the usual one [m].
        torso: roll, pitch and yaw against upright and facing as the feet do [rad].
        turns: how the left and the right foot are turned, to the left of ahead
            (`StepTeleoperator.ahead`) [rad].
    """

    height: Height = 0.0
    torso: tuple[Turn, Turn, Turn] = (0.0, 0.0, 0.0)
    turns: tuple[Turn, Turn] = (0.0, 0.0)


class Pad(Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="drive"):
    """What the operator does at one moment, whatever they do it with: all that leads says this.

    Keys, buttons that are held, sticks, handles on the page, and tracked hands or feet. It comes as
    JSON from a page or a program, which is checked as it is read.

    Attributes:
        lift: whether the left and the right foot shall be up.
        move: where the lifted foot goes, or the robot that is driven, forward and left, each from
            -1 to 1.
        second: a second stick, like `move`: with both feet held up `move` leads the left one only,
            and this the right one; with one of them either does.
        turn: where a robot that is driven turns, to the left, from -1 to 1.
        upright: whether the torso shall be brought upright.
        drag: where the left and the right foot's handle is held, in the drawn world; None for one
            that is not held [m].
        tracked: what leads the left and the right foot from a tracker; None for one that is not
            tracked, or not at this moment.
        hands: likewise for the left and the right hand; a handle of the page that is dragged is a
            closed clutch.
        head: where the operator looks; None without a headset, or where that is lost.
        rest: whether hands that nothing leads shall go back to rest, and the head look ahead.
        body: height, torso, and how the feet are turned.
        beat: the sender's clock, which it gets back to measure the latency [ms]. What is older than
            the newest is dropped, and so is what comes 0.5 s later than the soonest did. 0 for no
            clock.
    """

    lift: tuple[bool, bool] = (False, False)
    move: tuple[Deflection, Deflection] = (0.0, 0.0)
    second: tuple[Deflection, Deflection] = (0.0, 0.0)
    turn: Deflection = 0.0
    upright: bool = False
    drag: tuple[HandlePlace | None, HandlePlace | None] = (None, None)
    tracked: tuple[Tracked | None, Tracked | None] = (None, None)
    hands: tuple[Tracked | None, Tracked | None] = (None, None)
    head: Head | None = None
    rest: bool = False
    body: Body = Body()
    beat: float = 0.0


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
        pad = _within_reach(pad)
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


def _within_reach(pad: Pad) -> Pad:
    """A message in which hands and feet that are nowhere are lost."""
    if not any(map(_is_nowhere, (*pad.tracked, *pad.hands))):
        return pad
    tracked, hands = ((_reached(left), _reached(right)) for left, right in (pad.tracked, pad.hands))
    return replace(pad, tracked=tracked, hands=hands)


def _reached(tracked: Tracked | None) -> Tracked | None:
    return None if _is_nowhere(tracked) else tracked


def _is_nowhere(tracked: Tracked | None) -> bool:
    return tracked is not None and any(
        abs(part) >= _NOWHERE for part in (*tracked.position, *(tracked.velocity or ()))
    )


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
