"""The five modes of step teleoperation and the events that lead from one to another."""

from dataclasses import dataclass
from enum import Enum

from poise.errors import ConfigurationError


class Mode(Enum):
    """Which feet carry the robot (Zhang and Kikuuwe, section 3.2).

    Attributes:
        support: the foot that carries or shall carry the robot: 0 left, 1 right, None for both.
        single: whether one foot is in the air.
    """

    support: int | None
    single: bool

    D = "double support", None, False
    TL = "shifting to the left foot", 0, False
    TR = "shifting to the right foot", 1, False
    SL = "standing on the left foot", 0, True
    SR = "standing on the right foot", 1, True

    def __new__(cls, text: str, support: int | None, single: bool) -> "Mode":
        """Its value is the text; a tick asks some thirty times for the rest."""
        mode = object.__new__(cls)
        mode._value_, mode.support, mode.single = text, support, single
        return mode


class ModeEvent(Enum):
    """What leads from one mode to another, eq. (14)."""

    LIFT_RIGHT = "the right device was lifted"
    LIFT_LEFT = "the left device was lifted"
    SHIFTED = "the ZMP is in the foot that shall carry"
    LANDED = "the foot in the air has landed"
    CANCEL = "the device was lowered before the foot left the ground"


class StepEnd(Enum):
    """How a step, or the attempt at one, ended."""

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
}
"""The whole diagram: where each event leads; an event that is not here changes nothing.

`CANCEL` is not in the paper: with it an operator who thinks better of a step keeps both feet."""


@dataclass(slots=True)
class ModeMachine:
    """Keeps the mode.

    Attributes:
        mode: the mode now.
        since: when it began [s].
    """

    mode: Mode = Mode.D
    since: float = 0.0

    def advance(self, event: ModeEvent, time: float) -> bool:
        """Takes an event.

        Args:
            event: what happened.
            time: when [s].

        Returns:
            Whether the mode changed.
        """
        after = TRANSITIONS.get((self.mode, event))
        if after is None:
            return False
        self.mode, self.since = after, time
        return True


def draw_modes(fmt: str = "mermaid") -> str:
    """The diagram as text that documentation tools draw.

    Args:
        fmt: "mermaid" or "dot".

    Raises:
        ConfigurationError: another format.
    """
    edges = [(a.name, b.name, event.value) for (a, event), b in TRANSITIONS.items()]
    if fmt == "mermaid":
        return "\n".join(["stateDiagram-v2", *(f"    {a} --> {b}: {e}" for a, b, e in edges)])
    if fmt == "dot":
        return "\n".join(
            ["digraph {", *(f'    {a} -> {b} [label="{e}"]' for a, b, e in edges), "}"]
        )
    raise ConfigurationError("no such format of a diagram", got=fmt, choices=("mermaid", "dot"))
