"""`Gait` and `Stride`: how a robot walks, and where to."""

import math
from dataclasses import dataclass, fields

from poise.checks import checked_number
from poise.errors import ConfigurationError

_MOST_STEPS = 1000
"""More steps than this are no walk but a mistake."""

_SHORTEST_SWING = 0.1
"""A foot needs this long at least from lift-off to touchdown [s]."""


@dataclass(frozen=True, kw_only=True)
class Gait:
    """The timing and the shape of every step.

    Attributes:
        step_time: from one lift-off to the next [s].
        double_support: share of it that both feet stand [s].
        swing_height: how far a foot is lifted above the higher of its two ends [m].
        width: distance of the feet side by side [m]; as they stand when None.
        crouch: how far the centre of mass is lowered before the first step [m].
        shift_time: from the beginning to the first lift-off [s].
        settle_time: from the last touchdown to the end [s].
    """

    step_time: float = 0.7
    double_support: float = 0.15
    swing_height: float = 0.05
    width: float | None = None
    crouch: float = 0.0
    shift_time: float = 1.0
    settle_time: float = 1.5

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "crouch":
                checked_number(value, "crouch of the gait [m]")
            elif value is not None:
                checked_number(value, f"{field.name} of the gait [s, m]", above=0.0)
        if self.step_time - self.double_support < _SHORTEST_SWING:
            raise ConfigurationError(
                "the gait leaves a foot no time to swing",
                got=f"step_time {self.step_time:g} s, double_support {self.double_support:g} s",
                wanted=f"{_SHORTEST_SWING:g} s or more between the two",
            )

    @property
    def swing_time(self) -> float:
        """From lift-off to touchdown [s]."""
        return self.step_time - self.double_support


@dataclass(frozen=True, kw_only=True)
class Stride:
    """A number of steps of one kind.

    The body goes `length` ahead with every step. What it goes sideways and turns in two steps it
    does with the step of the foot on that side, so that the feet open first and close then, and
    are never nearer to each other than side by side.

    Attributes:
        steps: how many.
        length: ahead with each step [m]; backwards where negative.
        sideways: to the left, a step on average [m].
        turn: to the left, a step on average [rad].
    """

    steps: int
    length: float = 0.0
    sideways: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        whole = isinstance(self.steps, int) and not isinstance(self.steps, bool)  # pyright: ignore[reportUnnecessaryIsInstance]
        if not whole or not 1 <= self.steps <= _MOST_STEPS:
            raise ConfigurationError(
                "number of steps of a stride is out of range",
                got=self.steps,
                wanted=f"1 to {_MOST_STEPS}",
            )
        for name in ("length", "sideways", "turn"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not math.isfinite(value):
                raise ConfigurationError(
                    f"{name} of a stride is not a number", got=value, wanted="a finite number"
                )
