"""`SwingShape`: how high a foot is, and how far ahead, through a swing.

`clear_swing`: the smoothest one that knocks against nothing. `led_swing`: one whose goal may move.
"""

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from poise._checks import checked_number
from poise.dynamics import least_jerk
from poise.errors import ConfigurationError
from poise.locomotion._walking._ground import LEVEL, Ground, Placement

RISE = 0.45
"""Phase of the swing at which a foot is at its apex."""


@dataclass(frozen=True, kw_only=True)
class SwingShape:
    """The shape of one swing, over its phase from 0 at lift-off to 1 at touchdown.

    Attributes:
        apex: highest point of the sole, in the world [m].
        depart: phase at which the foot leaves its place sideways; before, it goes straight up.
        arrive: phase at which it is over its goal; from then on, it comes straight down.
    """

    apex: float
    depart: float = 0.0
    arrive: float = 0.93

    def __post_init__(self) -> None:
        if not math.isfinite(self.apex):
            raise ConfigurationError(
                "apex of a swing is not finite", got=self.apex, wanted="a height [m]"
            )
        checked_number(self.depart, "departure of a swing")
        if not self.depart < self.arrive <= 1.0:
            raise ConfigurationError(
                "a swing arrives before it departs, or after its end",
                got=(self.depart, self.arrive),
                wanted="0 <= depart < arrive <= 1",
            )

    def progress(self, phase: float) -> float:
        """Ratio of the horizontal displacement that is behind at a phase."""
        return least_jerk(phase, self.depart, self.arrive - self.depart)[0]

    def height(self, phase: float, begin: float, end: float) -> tuple[float, float, float]:
        """Height of the sole between lift-off and touchdown."""
        apex = max(self.apex, begin, end)
        if phase < RISE:
            ratio, rate, second = least_jerk(phase, 0.0, RISE)
            return begin + ratio * (apex - begin), rate * (apex - begin), second * (apex - begin)
        ratio, rate, second = least_jerk(phase, RISE, 1.0 - RISE)
        return apex + ratio * (end - apex), rate * (end - apex), second * (end - apex)


_SWINGS = ((0.0, 0.93), (0.1, 0.9), (0.15, 0.85), (0.2, 0.8), (0.25, 0.75), (0.3, 0.7))
"""Departure and arrival of a swing, from the smoothest to the one that clears most."""

_SAMPLES, _CLEAR, _BESIDE = 41, 0.01, 0.01
"""Moments at which a swing is looked at, and its distance from platforms below and beside [m]."""


def clear_swing(
    begin: Placement,
    goal: Placement,
    size: tuple[float, float],
    height: float,
    ground: Ground,
    number: int,
) -> SwingShape:
    """The smoothest swing above everything that lies under it."""
    high = max(begin.position[2], goal.position[2]) + height
    if not ground.platforms:
        return SwingShape(apex=high)
    phases = np.linspace(0.0, 1.0, _SAMPLES).tolist()
    for depart, arrive in _SWINGS:
        shape = SwingShape(apex=high, depart=depart, arrive=arrive)
        under = [_highest(begin, goal, shape.progress(p), size, ground) for p in phases]
        # What lies between may be higher than both ends.
        apex = max(high, max(under) + height)
        shape = SwingShape(apex=apex, depart=depart, arrive=arrive)
        if _is_clear(shape, begin.position[2], goal.position[2], phases, under):
            return shape
    raise ConfigurationError(
        f"step {number} of the walk would knock against a platform",
        got=f"swing_height {height:g} m",
        wanted="a higher swing, or other steps",
    )


def led_swing(
    begin: Placement,
    goal: Placement,
    size: tuple[float, float],
    height: float,
    ground: Ground,
    depth: float,
) -> SwingShape:
    """A swing whose goal may move: above all platforms where there is one, else the smoothest."""
    if ground.platforms:
        # A swing that would knock against one is made all the same: it may catch the robot.
        with suppress(ConfigurationError):
            return clear_swing(begin, goal, size, height, ground, 0)
    apex = max(begin.position[2], goal.position[2]) + height
    return SwingShape(apex=apex, arrive=1.0 - sinking_phase(depth, apex - goal.position[2]))


def sinking_phase(depth: float, fall: float) -> float:
    """Part of a swing's phase in which the foot goes from the ground to where it aims below it.

    At its end a quintic of least jerk is 10 H s^3 above where it ends, H its height and s the part
    of its time that is left.
    """
    if depth <= 0.0:
        return 0.0
    return (1.0 - RISE) * (0.1 * depth / (depth + max(fall, 0.0))) ** (1 / 3)


def _highest(
    begin: Placement, goal: Placement, ratio: float, size: tuple[float, float], ground: Ground
) -> float:
    """The highest ground under a sole between two places, with a margin around it [m]."""
    x, y = (a + ratio * (b - a) for a, b in zip(begin.position[:2], goal.position[:2], strict=True))
    place = Placement(position=(x, y, 0.0), yaw=begin.yaw + ratio * (goal.yaw - begin.yaw))
    grown = (size[0] + 2.0 * _BESIDE, size[1] + 2.0 * _BESIDE)
    return float(ground.heights(place.grid(*grown)).max())


def _is_clear(
    shape: SwingShape, begin: float, end: float, phases: list[float], under: list[float]
) -> bool:
    """Whether a sole is well above all that is higher than the ground it left or comes to."""
    for phase, ground in zip(phases, under, strict=True):
        own = begin if phase < RISE else end
        if ground > own + LEVEL and shape.height(phase, begin, end)[0] < ground + _CLEAR:
            return False
    return True
