"""`BodyHeight`: how high the body has to be for both legs to reach their feet, and when."""

import math

from poise.locomotion._walking._commands import side
from poise.locomotion._walking._flight import Flight, HeldFlight
from poise.locomotion._walking._footsteps import Gait, Stand
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._reach import LegSpan
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._stance import Stance

LOWEST = 0.9
"""Part of its height to which the COM goes down so that a leg reaches where it catches the
robot."""

_FALL = 1.0
"""Over a way down, the square of the time that the body takes for it [s^2/m]: with the least jerk,
its weight is never less than 0.4 of what it is."""

_SOONEST = 0.06
"""It takes this long at least [s]."""

_BODY_TIME = 0.25
"""The body turns and rises no faster than it takes for a goal this far away [s]."""


class BodyHeight:
    """Height and heading of the body that the next stand needs."""

    def __init__(
        self, sense: WalkSense, stand: Stand, span: LegSpan, gait: Gait, height: float
    ) -> None:
        self._sense, self._out, self._span = sense, 0.5 * stand.width, span
        self._gait, self._height = gait, height

    def goal(
        self,
        stance: Stance,
        flight: Flight | HeldFlight | None,
        now: float,
        *,
        slow: bool,
        offset: float = 0.0,
        lowest: float = LOWEST,
    ) -> tuple[float, float, float]:
        """Return height [m] and heading [rad] of the body, and the time until then [s]."""
        left, right = stance.feet
        low, yaw, time = min(left.position[2], right.position[2]), stance.heading, 0.0
        feet = [left, right]
        if flight is not None:
            foot = feet[1 - flight.foot]
            # A foot that looks for the ground takes the body down with it.
            sought = min(flight.goal.position[2], float(flight.swing.position[2]))
            low, yaw = min(foot.position[2], sought), 0.5 * (foot.yaw + flight.goal.yaw)
            time, feet[flight.foot] = flight.left, flight.goal
        asked = self._height + offset
        least = low + min(lowest * self._height, asked)
        height = max(self._reached(feet, low + asked, yaw, time), least)
        drop = now - height
        if drop > 0.0 and height < low + asked:
            return height, yaw, max(time, math.sqrt(_FALL * drop), _SOONEST)
        time = max(time + 0.5 * self._gait.double_support, _BODY_TIME)
        return height, yaw, max(time, self._gait.shift_time) if slow else time

    def _reached(self, feet: list[Placement], height: float, yaw: float, time: float) -> float:
        """Return the height of the CoM at which both legs will reach their feet [m]."""
        (x, y, _), (vx, vy, _) = self._sense.com, self._sense.com_velocity
        x, y = x + time * vx, y + time * vy
        left, ahead = self._out * math.cos(yaw), self._out * math.sin(yaw)
        for foot, place in enumerate(feet):
            out, position = side(foot), place.position
            hip = (x - out * ahead, y + out * left)
            height = min(height, position[2] + self._span.highest(math.dist(hip, position[:2])))
        return height
