"""`TorqueLimit`: bounds of the joint torques, and of how fast they change."""

from math import isnan

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise._compiled import compiled
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack._bound_once import Limit

SHORTEST_TICK, _LONGEST = 1e-3, 0.02
"""Bounds of the time between commands, which replace implausible clock readings [s]."""

SMOOTH_RATE = 250.0
"""Rate of the stacks that Poise makes [1/s]: half the limit in a tick of 2 ms."""


class TorqueLimit(Limit):
    """|tau| <= scale tau_max, joint by joint; and no torque changes faster than it may.

    Both bounds stand beside the equations of motion, above everything:

        max(-scale tau_max, tau_last - rate tau_max dt) <= tau
                                  tau <= min(scale tau_max, tau_last + rate tau_max dt)

    So no torque jumps, whatever contacts, limits and tasks require; a larger change is spread over
    several ticks. tau_last is the last commanded torque. A controller's first
    command is free, and so are the first after a tick without an answer, and many states at once.
    `OperationalSpaceController` keeps to its own `torque_step` in place of `rate`.

    Its settings are read-only: construct a new controller for another limit.

    Args:
        scale: fraction of the robot's torque limits that may be used.
        rate: how fast a torque may change, by its limit [1/s], as `SMOOTH_RATE`; None for no
            limit.

    Attributes:
        name: what reports call it.
        scale: fraction of the robot's torque limits that may be used.
        rate: largest rate of a torque over its limit [1/s]; None for no bound.
        lower: lower bounds; known once bound to a robot, as those below [N m].
        upper: upper bounds [N m].
        tick_lower: lower bounds in the tick that begins, those by the last command among them; the
            array stays [N m].
        tick_upper: upper bounds in the tick that begins [N m].
    """

    scale: float
    rate: float | None
    lower: Float64[np.ndarray, " nj"]
    upper: Float64[np.ndarray, " nj"]
    tick_lower: Float64[np.ndarray, " nj"]
    tick_upper: Float64[np.ndarray, " nj"]

    def __init__(self, scale: float = 1.0, rate: float | None = None) -> None:
        if rate is not None:
            rate = checked_number(rate, "rate of the torque limit [1/s]", above=0.0)
        scale = checked_number(scale, "scale of the torque limit", above=0.0)
        if scale > 1.0:
            raise ConfigurationError(
                "scale of the torque limit is above the robot's own limit",
                got=scale,
                wanted="a number in (0, 1]",
            )
        self._set(name="torque limit", scale=scale, rate=rate)

    def _bind(self, robot: Robot) -> None:
        most = self.scale * robot.tau_max
        per_second = (self.rate or 0.0) * robot.tau_max
        self._numbers = np.array([-most, most, -most, most, np.zeros(robot.nj), per_second])
        self._time = np.nan

    def share_memory(self) -> None:
        """Make the bounds views of the array that compiled code reads."""
        if self._robot is not None:
            lower, upper, tick_lower, tick_upper, self._last, _ = self._numbers
            self._set(lower=lower, upper=upper, tick_lower=tick_lower, tick_upper=tick_upper)
            # What is compiled is compiled now, not in the first tick.
            _bound_change(self._numbers, _LONGEST)
            if isnan(self._time):
                self.reset()

    def begin(self, time: float) -> None:
        """Set the bounds for a tick; controllers call it.

        Args:
            time: of the state [s].
        """
        if self.rate is None or isnan(self._time):
            return
        # Clocks that add up their ticks differ in the last digits, and answers should not.
        seconds = min(max(SHORTEST_TICK, round(time - self._time, 9)), _LONGEST)
        _bound_change(self._numbers, seconds)

    def remember(self, torque: Float64[np.ndarray, " nj"], time: float) -> None:
        """Copy a command, from which the next may be so far; controllers call it.

        Args:
            torque: as commanded [N m].
            time: for which [s].
        """
        if self.rate is not None:
            self._last[:], self._time = torque, time

    def reset(self) -> None:
        """Forget the last command: the next one is free."""
        self._time = np.nan
        self.tick_lower[:], self.tick_upper[:] = self.lower, self.upper


@compiled
def _bound_change(numbers: Float64[np.ndarray, "6 nj"], seconds: float) -> None:
    """Bounds of a tick: the limit's own, and no farther from the last command than allowed."""
    lower, upper, tick_lower, tick_upper = numbers[0], numbers[1], numbers[2], numbers[3]
    last, per_second = numbers[4], numbers[5]
    for i in range(len(last)):
        most = seconds * per_second[i]
        tick_lower[i] = max(lower[i], last[i] - most)
        tick_upper[i] = min(upper[i], last[i] + most)
