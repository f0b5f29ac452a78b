"""The divergent component of motion over the next few footholds, by backward recursion.

On the linear inverted pendulum, xi' = omega (xi - r) with the ZMP r. While that goes evenly from
r_0 to r_1 in a time T (Englsberger, Ott, Albu-Schaeffer 2015),

    xi(0) = r_0 + s + e^{-omega T} (xi(T) - r_1 - s),    s = (r_1 - r_0) / (omega T)

What is far ahead counts with e^{-omega t}: four steps are as good as all of them. Vectors are x and
y in the world, plain numbers.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from poise.locomotion._support import Point
from poise.locomotion._walking._leg_momentum import LegMomentum

REST_TIME = 0.3
"""How long the ZMP takes from the foot that stood last to where it rests [s]."""


class StepTimes(NamedTuple):
    """How long the phases of a step take.

    Attributes:
        swing: from lift-off to touchdown [s].
        double_support: from touchdown to the next lift-off [s].
    """

    swing: float
    double_support: float


def before_transfer(xi: Point, start: Point, end: Point, omega: float, time: float) -> Point:
    """Return xi before a linear transfer of the ZMP, from xi after it."""
    kept, ratio = math.exp(-omega * time), 1.0 / (omega * time)
    s_x, s_y = ratio * (end[0] - start[0]), ratio * (end[1] - start[1])
    return (
        start[0] + s_x + kept * (xi[0] - end[0] - s_x),
        start[1] + s_y + kept * (xi[1] - end[1] - s_y),
    )


def touchdown_dcm(
    feet: Sequence[Point],
    legs: LegMomentum,
    times: StepTimes,
    rest: Point | None = None,
) -> Point:
    """Where xi has to be at the next touchdown, so that all steps after it can be made as planned.

    Of `LegMomentum`, as everything here. It comes to rest over the last foothold, or where the
    robot stands on the last two.

    Args:
        feet: where the foot stands that stays, and footholds after it, a foot after the other [m].
        legs: the pendulum.
        times: of a step.
        rest: of the ZMP at the end [m].
    """
    omega = legs.omega
    xi = over = feet[-1] if rest is None else rest
    time = times.double_support if rest is None else REST_TIME
    for i in range(len(feet) - 1, 0, -1):
        behind, ahead = feet[i - 1], feet[i]
        stands = (behind, ahead)
        landed = legs.joined(behind, stands)
        xi = before_transfer(xi, landed, legs.joined(over, stands), omega, time)
        over, time = behind, times.double_support
        if i > 1:
            start = legs.joined(behind, (feet[i - 2], behind))
            xi = before_transfer(xi, start, landed, omega, times.swing)
    return xi


def transfer_gain(legs: LegMomentum, times: StepTimes) -> float:
    """How far `touchdown_dcm` moves with the next foothold and all after it, metre by metre."""
    here, there = (0.0, 0.0), (1.0, 0.0)
    return touchdown_dcm((here, there, there), legs, times)[0]


DcmMotion = tuple[float, float]
"""Position [m] and velocity [m/s] of xi along one axis."""


def hermite_step(now: DcmMotion, goal: DcmMotion, left: float, dt: float) -> DcmMotion:
    """One tick along the cubic that is at a goal, as fast as that asks for, in the time left.

    Position and velocity of xi are continuous, and with them the ZMP, r = xi - xi' / omega.
    """
    (x, v), (x1, v1) = now, goal
    if left <= dt:
        return goal
    acceleration = 6.0 * (x1 - x) / (left * left) - (4.0 * v + 2.0 * v1) / left
    jerk = 6.0 * (v + v1) / (left * left) - 12.0 * (x1 - x) / left**3
    return (
        x + dt * (v + dt * (0.5 * acceleration + dt * jerk / 6.0)),
        v + dt * (acceleration + 0.5 * dt * jerk),
    )
