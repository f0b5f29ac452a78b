"""Shape of a swing, and the least-jerk motion towards a goal."""

from dataclasses import dataclass, replace

import numpy as np

from poise.dynamics import least_jerk
from poise.locomotion._walking._ground import CLEARANCE, LEVEL, Ground, Placement

RISE = 0.45
"""Phase of the swing at which a foot is at its apex."""

FIXED = 0.06
"""The goal does not move any more when the foot is this near to its arrival [s]."""

Motion = tuple[float, float, float]
"""Position [m], velocity [m/s] and acceleration [m/s^2] along one axis of the world; or angles."""


@dataclass(frozen=True, kw_only=True)
class SwingShape:
    """The shape of one swing, over its phase from 0 at lift-off to 1 at touchdown."""

    apex: float  # highest point of the sole, in the world [m]
    depart: float = 0.0  # phase until which the foot goes straight up
    arrive: float = 0.93  # phase at which it is over its goal; from then on, it comes straight down

    def progress(self, phase: float) -> float:
        """Ratio of the horizontal displacement that is behind at a phase."""
        return least_jerk(phase, self.depart, self.arrive - self.depart)[0]

    def height(self, phase: float, begin: float, end: float) -> Motion:
        """Height of the sole between lift-off and touchdown, and its rates by the phase."""
        apex = max(self.apex, begin, end)
        if phase < RISE:
            low, way, part = begin, apex - begin, least_jerk(phase, 0.0, RISE)
        else:
            low, way, part = apex, end - apex, least_jerk(phase, RISE, 1.0 - RISE)
        return low + part[0] * way, part[1] * way, part[2] * way


_SWINGS = ((0.0, 0.93), (0.1, 0.9), (0.15, 0.85), (0.2, 0.8), (0.25, 0.75), (0.3, 0.7))
"""Departure and arrival of a swing, from the smoothest to the one that clears most."""

_SAMPLES = 41
"""Moments at which a swing is looked at."""


def clear_swing(
    begin: Placement, goal: Placement, size: tuple[float, float], height: float, ground: Ground
) -> SwingShape | None:
    """Return the smoothest swing above all platforms under it; None where each one would knock."""
    start, end = begin.position[2], goal.position[2]
    high = max(start, end) + height
    phases = np.linspace(0.0, 1.0, _SAMPLES).tolist()
    for depart, arrive in _SWINGS:
        shape = SwingShape(apex=high, depart=depart, arrive=arrive)
        under = [_highest(begin, goal, shape.progress(p), size, ground) for p in phases]
        # What lies between may be higher than both ends.
        shape = replace(shape, apex=max(high, max(under) + height))
        if all(
            top <= (start if phase < RISE else end) + LEVEL
            or shape.height(phase, start, end)[0] >= top + CLEARANCE
            for phase, top in zip(phases, under, strict=True)
        ):
            return shape
    return None


def led_swing(
    begin: Placement,
    goal: Placement,
    size: tuple[float, float],
    height: float,
    ground: Ground,
    depth: float,
) -> SwingShape:
    """A swing whose goal may move: above all platforms where there is one, else the smoothest."""
    # A swing that would knock against one is made all the same: it may catch the robot.
    clear = clear_swing(begin, goal, size, height, ground) if ground.platforms else None
    apex = max(begin.position[2], goal.position[2]) + height
    sinking = sinking_phase(depth, apex - goal.position[2])
    return clear or SwingShape(apex=apex, arrive=1.0 - sinking)


def sinking_phase(depth: float, fall: float) -> float:
    """Return the phase in which a foot goes from the ground to the depth at which it aims."""
    # At its end a quintic of least jerk is 10 H s^3 above where it ends, s the time left over all.
    if depth <= 0.0:
        return 0.0
    return (1.0 - RISE) * (0.1 * depth / (depth + max(fall, 0.0))) ** (1 / 3)


def _highest(
    begin: Placement, goal: Placement, ratio: float, size: tuple[float, float], ground: Ground
) -> float:
    """The highest ground under a sole between two places, with a margin around it [m]."""
    x, y = (a + ratio * (b - a) for a, b in zip(begin.position[:2], goal.position[:2], strict=True))
    place = Placement(position=(x, y, 0.0), yaw=begin.yaw + ratio * (goal.yaw - begin.yaw))
    grown = (size[0] + 2.0 * CLEARANCE, size[1] + 2.0 * CLEARANCE)
    return float(ground.heights(place.grid(*grown)).max())


def least_jerk_towards(axis: Motion, goal: float, left: float, dt: float) -> Motion:
    """One tick of the least-jerk motion that arrives at rest in the time that is left [s]."""
    x, v, a = axis
    if left <= FIXED:
        # Too short to plan anew: three poles, fast and equal, deal with the last millimetre.
        pole = 3.0 / FIXED
        jerk = pole**3 * (goal - x) - 3.0 * pole**2 * v - 3.0 * pole * a
    else:
        jerk = (60.0 * (goal - x) / left - 36.0 * v) / (left * left) - 9.0 * a / left
    return (
        x + dt * (v + dt * (0.5 * a + dt * jerk / 6.0)),
        v + dt * (a + 0.5 * dt * jerk),
        a + dt * jerk,
    )
