"""`Pad`: what the operator does at one moment, whatever they do it with, and the parts of it."""

from typing import Annotated

from msgspec import Meta, Struct
from msgspec.structs import replace

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


def within_reach(pad: Pad) -> Pad:
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
