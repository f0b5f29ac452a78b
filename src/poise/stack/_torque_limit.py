"""`TorqueLimit`: bounds of the joint torques, and of how fast they change."""

from math import isnan

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise._compiled import MemoryBlock, compiled, view
from poise._copies import Copied
from poise.errors import ConfigurationError
from poise.robots import Robot

_SHORTEST, _LONGEST = 1e-3, 0.02
"""Between which the time from one command to the next is taken to be, whatever clocks say [s]."""

SMOOTH_RATE = 250.0
"""Rate of the stacks that Poise makes [1/s]: half the limit in a tick of 2 ms."""


class _TorqueBounds(MemoryBlock):
    lower: Float64[np.ndarray, " nj"]  # of the limit itself [N m]
    upper: Float64[np.ndarray, " nj"]
    tick_lower: Float64[np.ndarray, " nj"]  # of the tick that begins [N m]
    tick_upper: Float64[np.ndarray, " nj"]
    last: Float64[np.ndarray, " nj"]  # command [N m]
    per_second: Float64[np.ndarray, " nj"]  # largest change [N m/s]


class TorqueLimit(Copied):
    """|tau| <= scale tau_max, joint by joint; and no torque changes faster than it may.

    Both bounds stand beside the equations of motion, above everything:

        max(-scale tau_max, tau_last - rate tau_max dt) <= tau
                                  tau <= min(scale tau_max, tau_last + rate tau_max dt)

    So no torque jumps, whatever contacts, limits and tasks would give for it: what they need more
    they get some ticks later. tau_last is what the controller commanded last. A controller's first
    command is free, and so are the first after a tick without an answer, and many states at once.
    `OperationalSpaceController` keeps to its own `torque_step` in place of `rate`.

    What it is made of is for reading: another limit makes another controller.

    Args:
        scale: fraction of the robot's torque limits that may be used.
        rate: how fast a torque may change, by its limit [1/s], as `SMOOTH_RATE`; None for as fast
            as it likes.

    Attributes:
        name: what reports call it.
    """

    foreign = ("_numbers",)

    def __init__(self, scale: float = 1.0, rate: float | None = None) -> None:
        self.name = "torque limit"
        self._rate = rate
        if rate is not None:
            self._rate = checked_number(rate, "rate of the torque limit [1/s]", above=0.0)
        self._scale = checked_number(scale, "scale of the torque limit", above=0.0)
        if self._scale > 1.0:
            raise ConfigurationError(
                "scale of the torque limit is above the robot's own limit",
                got=scale,
                wanted="a number in (0, 1]",
            )
        self._robot: Robot | None = None

    @property
    def scale(self) -> float:
        """Fraction of the robot's torque limits that may be used."""
        return self._scale

    @property
    def rate(self) -> float | None:
        """Largest rate of a torque over its limit [1/s]; None for no bound."""
        return self._rate

    @property
    def lower(self) -> Float64[np.ndarray, " nj"]:
        """Lower bounds, known once bound to a robot [N m]."""
        return self._lower

    @property
    def upper(self) -> Float64[np.ndarray, " nj"]:
        """Upper bounds, known once bound to a robot [N m]."""
        return self._upper

    @property
    def tick_lower(self) -> Float64[np.ndarray, " nj"]:
        """Lower bounds in the tick that begins, those by the last command among them [N m].

        The array stays.
        """
        return self._tick_lower

    @property
    def tick_upper(self) -> Float64[np.ndarray, " nj"]:
        """Upper ones [N m]."""
        return self._tick_upper

    def bind(self, robot: Robot) -> None:
        """Take the limits of a robot; controllers call it before the first tick.

        Raises:
            ConfigurationError: the limit serves another robot.
        """
        if self._robot is not None and self._robot is not robot:
            raise ConfigurationError(
                "the torque limit already serves another robot",
                got=robot.name,
                wanted=f"robot {self._robot.name!r}, or a limit of its own",
            )
        self._robot = robot
        self._upper: Float64[np.ndarray, " nj"] = self._scale * robot.tau_max
        self._lower: Float64[np.ndarray, " nj"] = -self._upper
        self._tick_lower, self._tick_upper = self._lower.copy(), self._upper.copy()
        self._last, self._time = np.zeros(robot.nj), np.nan
        self._per_second = (self._rate or 0.0) * robot.tau_max
        self.share_memory()

    def share_memory(self) -> None:
        """Make the memory of compiled code from the bounds in place."""
        if self._robot is None:
            return
        self._numbers = _TorqueBounds(
            lower=self._lower,
            upper=self._upper,
            tick_lower=self._tick_lower,
            tick_upper=self._tick_upper,
            last=self._last,
            per_second=self._per_second,
        )
        # What is compiled is compiled now, not in the first tick.
        _bound_change(self._numbers.address, _LONGEST)
        if isnan(self._time):
            self.reset()

    def begin(self, time: float) -> None:
        """Set the bounds for a tick; controllers call it.

        Args:
            time: of the state [s].
        """
        if self._rate is None or isnan(self._time):
            return
        # Clocks that add up their ticks differ in the last digits, and answers should not.
        seconds = min(max(_SHORTEST, round(time - self._time, 9)), _LONGEST)
        _bound_change(self._numbers.address, seconds)

    def remember(self, torque: Float64[np.ndarray, " nj"], time: float) -> None:
        """Copy a command, from which the next may be so far; controllers call it.

        Args:
            torque: as commanded [N m].
            time: for which [s].
        """
        if self._rate is None:
            return
        self._last[:], self._time = torque, time

    def reset(self) -> None:
        """Forget the last command: the next one is free."""
        self._time = np.nan
        self._tick_lower[:], self._tick_upper[:] = self._lower, self._upper


@compiled
def _bound_change(address: int, seconds: float) -> None:
    """Bounds of a tick: the limit's own, and no farther from the last command than allowed."""
    m = view(_TorqueBounds, address)
    for i in range(len(m.last)):
        most = seconds * m.per_second[i]
        m.tick_lower[i] = max(m.lower[i], m.last[i] - most)
        m.tick_upper[i] = min(m.upper[i], m.last[i] + most)
