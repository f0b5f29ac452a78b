"""`StepMachine`: double support, weight shift and single support, for any source of steps."""

from dataclasses import dataclass
from enum import Enum

from poise.errors import ConfigurationError


class Mode(Enum):
    """Feet that carry the robot (Zhang and Kikuuwe, section 3.2).

    Attributes:
        support: stance foot, also of the coming single support: 0 left, 1 right, None for both.
        single: whether it is single support.
    """

    support: int | None
    single: bool

    D = "standing on both feet", None, False
    TL = "weight shift to the left foot", 0, False
    TR = "weight shift to the right foot", 1, False
    SL = "standing on the left foot", 0, True
    SR = "standing on the right foot", 1, True

    def __new__(cls, text: str, support: int | None, single: bool) -> "Mode":
        mode = object.__new__(cls)
        mode._value_, mode.support, mode.single = text, support, single
        return mode


class ModeEvent(Enum):
    """Event that changes the mode, eq. (14)."""

    LIFT_RIGHT = "the right foot is to be lifted"
    LIFT_LEFT = "the left foot is to be lifted"
    SHIFTED = "the weight is on the stance foot"
    LANDED = "touchdown of the swing foot"
    CANCEL = "the foot stays on the ground"
    CATCH_RIGHT = "the right foot hangs in the air"
    CATCH_LEFT = "the left foot hangs in the air"


LIFT = (ModeEvent.LIFT_LEFT, ModeEvent.LIFT_RIGHT)
CATCH = (ModeEvent.CATCH_LEFT, ModeEvent.CATCH_RIGHT)
"""Events by foot, 0 for the left one."""


class StepEnd(Enum):
    """End of a step, or of the attempt at one."""

    LANDED = "the foot has landed"
    LOWERED = "lowered before the foot had left the ground"
    LATE = "the weight came too late; lower, and lift again"
    STUCK = "the foot went on carrying; lower, and lift again"
    RESCUED = "put down so as not to fall; lower, and lift again"
    OVERRULED = "the robot stepped by itself; take hold of each foot anew"
    LOST = "the device was lost"


TRANSITIONS: dict[tuple[Mode, ModeEvent], Mode] = {
    (Mode.D, ModeEvent.LIFT_RIGHT): Mode.TL,
    (Mode.D, ModeEvent.LIFT_LEFT): Mode.TR,
    (Mode.TL, ModeEvent.SHIFTED): Mode.SL,
    (Mode.TR, ModeEvent.SHIFTED): Mode.SR,
    (Mode.SL, ModeEvent.LANDED): Mode.D,
    (Mode.SR, ModeEvent.LANDED): Mode.D,
    (Mode.TL, ModeEvent.CANCEL): Mode.D,
    (Mode.TR, ModeEvent.CANCEL): Mode.D,
    (Mode.TL, ModeEvent.LIFT_LEFT): Mode.TR,
    (Mode.TR, ModeEvent.LIFT_RIGHT): Mode.TL,
    **{(mode, ModeEvent.CATCH_RIGHT): Mode.SL for mode in (Mode.D, Mode.TL, Mode.TR)},
    **{(mode, ModeEvent.CATCH_LEFT): Mode.SR for mode in (Mode.D, Mode.TL, Mode.TR)},
}
"""Transition table; an event without an entry keeps the mode. The first six are the paper's."""


@dataclass(slots=True)
class StepMachine:
    """The mode, and since when."""

    mode: Mode = Mode.D  # the mode now
    since: float = 0.0  # when it began [s]

    def advance(self, event: ModeEvent, time: float) -> bool:
        """Take an event; return whether the mode changed."""
        after = TRANSITIONS.get((self.mode, event))
        if after is None:
            return False
        self.mode, self.since = after, time
        return True

    def stand(self, time: float) -> None:
        """Begin double support, whatever the mode."""
        self.mode, self.since = Mode.D, time


def draw_modes(fmt: str = "mermaid") -> str:
    """The diagram as text that documentation tools draw."""
    edges = [(a.name, b.name, event.value) for (a, event), b in TRANSITIONS.items()]
    if fmt == "mermaid":
        return "\n".join(["stateDiagram-v2", *(f"    {a} --> {b}: {e}" for a, b, e in edges)])
    if fmt == "dot":
        return "\n".join(
            ["digraph {", *(f'    {a} -> {b} [label="{e}"]' for a, b, e in edges), "}"]
        )
    raise ConfigurationError("no such format of a diagram", got=fmt, choices=("mermaid", "dot"))
