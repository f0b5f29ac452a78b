"""`JointLimit`: position, velocity and acceleration limits as one pair of acceleration bounds.

`TorqueLimit`: bounds of the joint torques.
"""

from collections.abc import Mapping
from math import isnan, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise._compiled import compiled, part
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.robots import Robot

_SHORTEST, _LONGEST = 1e-3, 0.02
"""Between which the time from one command to the next is taken to be, whatever clocks say [s]."""

SMOOTH_RATE = 250.0
"""Rate of the stacks that Poise makes [1/s]: half the limit in a tick of 2 ms."""


class TorqueLimit:
    """|tau| <= scale tau_max, joint by joint; and no torque changes faster than it may.

    Both bounds stand beside the equations of motion, above everything:

        max(-scale tau_max, tau_last - rate tau_max dt) <= tau
                                  tau <= min(scale tau_max, tau_last + rate tau_max dt)

    So no torque jumps, whatever contacts, limits and tasks would give for it: what they need more
    they get some ticks later. tau_last is what the controller commanded last. A controller's first
    command is free, and so are the first after a tick without an answer, and many states at once.

    What it is made of is for reading: another limit makes another controller.

    Args:
        scale: fraction of the robot's torque limits that may be used.
        rate: how fast a torque may change, by its limit [1/s], as `SMOOTH_RATE`; None for as fast
            as it likes.

    Attributes:
        name: what reports call it.
    """

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
        """How fast a torque may change, by its limit [1/s]; None for as fast as it likes."""
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
        """Takes the limits of a robot; controllers call it before the first tick.

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
        self._per_second = np.inf if self._rate is None else self._rate * robot.tau_max

    def begin(self, time: float) -> None:
        """Sets the bounds for a tick; controllers call it.

        Args:
            time: of the state [s].
        """
        if self._rate is None or isnan(self._time):
            return
        # Clocks that add up their ticks differ in the last digits, and answers should not.
        step = min(max(_SHORTEST, round(time - self._time, 9)), _LONGEST) * self._per_second
        np.maximum(self._lower, self._last - step, out=self._tick_lower)
        np.minimum(self._upper, self._last + step, out=self._tick_upper)

    def remember(self, torque: Float64[np.ndarray, " nj"], time: float) -> None:
        """Copies a command, from which the next may be so far; controllers call it.

        Args:
            torque: as commanded [N m].
            time: for which [s].
        """
        if self._rate is None:
            return
        self._last[:], self._time = torque, time

    def reset(self) -> None:
        """Forgets the last command: the next one is free."""
        self._time = np.nan
        self._tick_lower[:], self._tick_upper[:] = self._lower, self._upper


_STOP_FRACTION = 0.5
"""Fraction of the horizon in which a joint about to pass its limit stops.

It bounds the braking gain near the limit, where v^2 / 2s would turn measurement noise into full
braking: an ankle that stands at its limit is then asked for what its sole on the ground cannot do,
and all tasks below give way for that tick. The price is that a joint may pass its limit by
`a_max (fraction dt)^2 / 2`, 10 mrad with the defaults, where it came in need of full braking, and
by a fortieth of that where it came as planned. The position margin is there for it."""

_TINY = 1e-12
"""Keeps a joint at rest on its limit from dividing by zero [rad]."""


class JointLimit:
    """Bounds on joint accelerations that keep position, velocity and acceleration limits.

    The bounds are the viability bounds of Del Prete ("Joint Position and Velocity Bounds in
    Discrete-Time Acceleration/Torque Control of Robot Manipulators", RA-L 2018): a joint may not
    go so fast that braking at b could no longer stop it before its limit. With s the distance to
    the upper limit, an acceleration a held for one horizon dt is viable if

        (v + a dt)^2 <= 2 b (s - v dt - a dt^2 / 2)         and     v + a dt <= v_max,

    and where the joint has to be at rest sooner than dt, if a <= -v^2 / 2s.

    Position and velocity limits never make the problem infeasible: `lower <= upper` holds for
    every state. A joint that is beyond a limit is asked back within one horizon, as far as the
    acceleration limit allows. Where bounds contradict each other, as a position limit that needs
    harder braking than a velocity limit would have, both become the one that brakes.

    Torque controllers leave out of v what joints beside a contact do only because that still moves,
    and ask those joints for no more than `braking`, nor for `braking_of`: see `bound_settling`.

    What it is made of is for reading: another limit makes another controller.

    Args:
        acceleration_max: largest joint acceleration [rad/s^2].
        braking: deceleration b with which a joint plans to stop before its position limit, at most
            `acceleration_max`; low, so that braking starts early and does not jerk the robot
            [rad/s^2].
        horizon: dt, at least twice the control period so that braking starts smoothly [s].
        position_margin: distance kept from the position limits [rad].
        velocity_scale: fraction of the robot's velocity limits that may be used.
        position_range: narrower position limits, lower and upper, by joint name [rad].
        braking_of: braking of joints that stop otherwise than the rest, by joint name [rad/s^2].

    Attributes:
        name: what reports call it.
    """

    def __init__(
        self,
        *,
        acceleration_max: float = 200.0,
        braking: float = 8.0,
        horizon: float = 0.02,
        position_margin: float = 0.01,
        velocity_scale: float = 1.0,
        position_range: Mapping[str, tuple[float, float]] | None = None,
        braking_of: Mapping[str, float] | None = None,
    ) -> None:
        self.name = "joint limit"
        self._acceleration_max = checked_number(
            acceleration_max, "acceleration_max of the joint limit [rad/s^2]", above=0.0
        )
        self._braking = self._checked_braking(braking, "braking of the joint limit [rad/s^2]")
        self._braking_of = {
            name: self._checked_braking(b, f"braking of joint {name!r} [rad/s^2]")
            for name, b in (braking_of or {}).items()
        }
        self._horizon = checked_number(horizon, "horizon of the joint limit [s]", above=0.0)
        self._position_margin = checked_number(
            position_margin, "position_margin of the joint limit [rad]"
        )
        self._velocity_scale = checked_number(
            velocity_scale, "velocity_scale of the joint limit", above=0.0
        )
        self._position_range = dict(position_range or {})
        for name, (lower, upper) in self._position_range.items():
            if not lower < upper:
                raise ConfigurationError(
                    f"position_range of joint {name!r} in the joint limit is none",
                    got=(lower, upper),
                    wanted="lower < upper [rad]",
                )
        self._robot: Robot | None = None

    def _checked_braking(self, braking: float, what: str) -> float:
        return min(checked_number(braking, what, above=0.0), self._acceleration_max)

    @property
    def acceleration_max(self) -> float:
        """Largest joint acceleration [rad/s^2]."""
        return self._acceleration_max

    @property
    def braking(self) -> float:
        """Deceleration with which a joint plans to stop before its position limit [rad/s^2]."""
        return self._braking

    @property
    def braking_of(self) -> dict[str, float]:
        """The same of joints that stop otherwise than the rest, by joint name [rad/s^2]."""
        return dict(self._braking_of)

    @property
    def horizon(self) -> float:
        """Horizon dt of the bounds [s]."""
        return self._horizon

    @property
    def position_margin(self) -> float:
        """Distance kept from the position limits [rad]."""
        return self._position_margin

    @property
    def velocity_scale(self) -> float:
        """Fraction of the robot's velocity limits that may be used."""
        return self._velocity_scale

    @property
    def q_min(self) -> Float64[np.ndarray, " nj"]:
        """Lower position limits, margin included; known once bound to a robot [rad]."""
        return self._q_min

    @property
    def q_max(self) -> Float64[np.ndarray, " nj"]:
        """Upper position limits, margin included; known once bound to a robot [rad]."""
        return self._q_max

    @property
    def lower(self) -> Float64[np.ndarray, " nj"]:
        """Lower bounds of the joint accelerations at the last state [rad/s^2]."""
        return self._lower

    @property
    def upper(self) -> Float64[np.ndarray, " nj"]:
        """Upper bounds of the joint accelerations at the last state [rad/s^2]."""
        return self._upper

    def bind(self, robot: Robot) -> None:
        """Takes the limits of a robot; controllers call it before the first tick.

        Raises:
            UnknownNameError: a range or a braking of a joint that the robot does not have.
            ConfigurationError: margin or range leave a joint no room, or the limit serves another
                robot.
        """
        if self._robot is robot:
            return
        if self._robot is not None:
            raise ConfigurationError(
                "the joint limit already serves another robot",
                got=robot.name,
                wanted=f"robot {self._robot.name!r}, or a limit of its own",
            )
        q_min, q_max = robot.q_min + self._position_margin, robot.q_max - self._position_margin
        for name, (lower, upper) in self._position_range.items():
            i = robot.joint_index(name)
            q_min[i], q_max[i] = max(q_min[i], lower), min(q_max[i], upper)
        self._q_min: Float64[np.ndarray, " nj"] = q_min
        self._q_max: Float64[np.ndarray, " nj"] = q_max
        crossed = np.flatnonzero(q_min >= q_max)
        if crossed.size:
            raise ConfigurationError(
                "position_margin and position_range of the joint limit leave joints no range: "
                + ", ".join(robot.joint_names[i] for i in crossed),
                got=self._position_margin,
                wanted="a smaller margin, or a wider range [rad]",
            )
        braking = np.full(robot.nj, self._braking)
        for name, b in self._braking_of.items():
            braking[robot.joint_index(name)] = b
        self._q_slice = slice(robot.nq - robot.nj, robot.nq)
        self._v_slice = slice(robot.base_dofs, robot.nv)
        self._viable = ViableAcceleration(
            q_min,
            q_max,
            self._velocity_scale * robot.v_max,
            a_max=self._acceleration_max,
            dt=self._horizon,
            braking=braking,
            gentle=np.minimum(braking, self._braking),
        )
        self._lower: Float64[np.ndarray, " nj"] = np.zeros(robot.nj)
        self._upper: Float64[np.ndarray, " nj"] = np.zeros(robot.nj)
        self._robot = robot

    def evaluate(self, dynamics: Dynamics) -> None:
        """Fills `lower` and `upper` for one state.

        Args:
            dynamics: the state, up to date.
        """
        q, v = dynamics.q[self._q_slice], dynamics.v[self._v_slice]
        self._viable.bounds(q, v, self._lower, self._upper)

    @property
    def viability(self) -> "Viability":
        """What the bounds are made from; known once bound to a robot."""
        return self._viable.viability


class Viability(NamedTuple):
    """What the bounds of joint accelerations are made from.

    Attributes:
        q_min: lower position limits [rad].
        q_max: upper position limits [rad].
        v_max: velocity limits [rad/s].
        braking: decelerations that stopping is planned with [rad/s^2].
        gentle: the same of joints beside contacts, and the most that these are asked for [rad/s^2].
        a_max: acceleration limit [rad/s^2].
        dt: horizon [s].
    """

    q_min: Float64[np.ndarray, " nj"]
    q_max: Float64[np.ndarray, " nj"]
    v_max: Float64[np.ndarray, " nj"]
    braking: Float64[np.ndarray, " nj"]
    gentle: Float64[np.ndarray, " nj"]
    a_max: float
    dt: float


class ViableAcceleration:
    """Accelerations after which a joint can still stop before its position limits.

    With s = q_max - q the largest one is the larger root of

        dt^2 a^2 + dt (2 v + b dt) a + v^2 - 2 b (s - v dt) = 0,

        a = sqrt(2 b (s - v dt / 2) / dt^2 + b^2 / 4) - (v / dt + b / 2),

    as long as the joint may still move towards the limit at dt, that is for s >= v dt / 2. Nearer
    to it the joint must be at rest sooner, which takes -v^2 / 2s; the root would let it swing past
    the limit and return to it at dt. The smallest one is its mirror image. Where the two cross,
    both become the one that brakes.

    Args:
        q_min: lower position limits [rad].
        q_max: upper position limits [rad].
        v_max: velocity limits [rad/s].
        a_max: acceleration limit [rad/s^2].
        dt: horizon [s].
        braking: b, the decelerations that stopping is planned with [rad/s^2].
        gentle: the same beside contacts, see `bound_settling`; as elsewhere when None [rad/s^2].

    Attributes:
        viability: all of them.
    """

    def __init__(
        self,
        q_min: Float64[np.ndarray, " nj"],
        q_max: Float64[np.ndarray, " nj"],
        v_max: Float64[np.ndarray, " nj"],
        *,
        a_max: float,
        dt: float,
        braking: Float64[np.ndarray, " nj"],
        gentle: Float64[np.ndarray, " nj"] | None = None,
    ) -> None:
        gentle = braking if gentle is None else gentle
        self.viability = Viability(q_min, q_max, v_max, braking, gentle, float(a_max), float(dt))

    def bounds(
        self,
        q: Float64[np.ndarray, " nj"],
        v: Float64[np.ndarray, " nj"],
        lower: Float64[np.ndarray, " nj"],
        upper: Float64[np.ndarray, " nj"],
    ) -> None:
        """Bounds in [-a_max, a_max], which never cross.

        Args:
            q: positions [rad].
            v: velocities [rad/s].
            lower: receives the lower bounds [rad/s^2].
            upper: receives the upper bounds [rad/s^2].
        """
        _bounds(q, v, self.viability, lower, upper)


@compiled
def _bounds(
    q: Float64[np.ndarray, " nj"],
    v: Float64[np.ndarray, " nj"],
    viability: Viability,
    lower: Float64[np.ndarray, " nj"],
    upper: Float64[np.ndarray, " nj"],
) -> None:
    for i in range(len(q)):
        bound_joint(i, q[i], v[i], viability.braking[i], viability, lower, upper)


@part
def bound_joint(
    i: int,
    q: float,
    v: float,
    braking: float,
    viability: Viability,
    lower: Float64[np.ndarray, " nj"],
    upper: Float64[np.ndarray, " nj"],
) -> None:
    """The bounds of one joint.

    Args:
        i: which.
        q: its position [rad].
        v: its velocity [rad/s].
        braking: with what it plans to stop [rad/s^2].
        viability: of all joints.
        lower: receives the lower bound [rad/s^2].
        upper: receives the upper one.
    """
    settings, v_max = (viability.a_max, viability.dt, braking), viability.v_max[i]
    upper[i] = largest_acceleration(viability.q_max[i] - q, v, v_max, settings)
    lower[i] = -largest_acceleration(q - viability.q_min[i], -v, v_max, settings)
    if lower[i] > upper[i]:
        lower[i] = upper[i] = upper[i] if v > 0.0 else lower[i]


@compiled
def largest_acceleration(
    s: float, v: float, v_max: float, settings: tuple[float, float, float]
) -> float:
    """The largest acceleration of a joint at a distance s from a limit, towards which it moves."""
    a_max, dt, b = settings
    if s < 0.5 * v * dt:
        a = _stop_at_once(s, v, dt)
    else:
        a = sqrt(2.0 * b * (s - 0.5 * v * dt) / (dt * dt) + 0.25 * b * b) - (v / dt + 0.5 * b)
    return max(-a_max, min(a, (v_max - v) / dt, a_max))


@compiled
def _stop_at_once(s: float, v: float, dt: float) -> float:
    """What a joint that is within half a horizon of its limit, or beyond it, may do."""
    approach = max(v, 0.0)
    distance = max(s, 0.5 * _STOP_FRACTION * dt * approach + _TINY)
    stop = -0.5 * approach * approach / distance
    # Beyond the limit: back to it at dt, counting the speed at which the joint returns already.
    return stop + (2.0 / (dt * dt)) * (min(s, 0.0) + dt * (approach - v))
