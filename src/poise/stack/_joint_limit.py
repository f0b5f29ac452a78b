"""`JointLimit`: position, velocity and acceleration limits as one pair of acceleration bounds.

`Settling`: the same beside contacts that do not lie still.
"""

from collections.abc import Mapping
from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise._compiled import (
    MemoryBlock,
    allocate,
    compiled,
    factor_leading,
    part,
    solve_leading,
    view,
)
from poise.dynamics import Dynamics, StateNumbers
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack._bound_once import Limit
from poise.stack._tables import Line, StackNumbers, line_of

_STOP_FRACTION = 0.5
"""Fraction of the horizon in which a joint about to pass its limit stops.

It bounds the braking gain near the limit, where v^2 / 2s would turn measurement noise into full
braking: an ankle that stands at its limit is then asked for what its sole on the ground cannot do,
and all tasks below give way for that tick. The price is that a joint may pass its limit by
`a_max (fraction dt)^2 / 2`, 10 mrad with the defaults, where it came in need of full braking, and
by a fortieth of that where it came as planned. The position margin is there for it."""

_RETURN = 10.0
"""In how many horizons a joint beside a contact comes back from beyond its limit."""

_TINY = 1e-12
"""Keeps a joint at rest on its limit from dividing by zero [rad]."""

_SINGULAR = 1e-4
"""Added to the squares of how joints move a contact [m^2, 1]: motions that a leg which is all but
straight could only do very fast are not taken to happen."""


class Viability(MemoryBlock):
    """Inputs of the bounds of joint accelerations."""

    q_min: Float64[np.ndarray, " nj"]  # position limits [rad]
    q_max: Float64[np.ndarray, " nj"]
    v_max: Float64[np.ndarray, " nj"]  # velocity limits [rad/s]
    braking: Float64[np.ndarray, " nj"]  # decelerations that stopping is planned with [rad/s^2]
    gentle: Float64[np.ndarray, " nj"]  # the same beside contacts, and the most asked for there
    # `acceleration_max` [rad/s^2], `horizon` [s], `position_margin` [rad]
    settings: Float64[np.ndarray, " settings"]


class Settling(MemoryBlock):
    """Joint limits, and room for `bound_settling`."""

    viability: Viability
    lower: Float64[np.ndarray, " nj"]  # bounds of the joint accelerations [rad/s^2]
    upper: Float64[np.ndarray, " nj"]
    gram: Float64[np.ndarray, "six six"]  # how the joints of a contact move it, squared
    slip: Float64[np.ndarray, " six"]  # velocity of a contact [m/s, rad/s]
    change: Float64[np.ndarray, " six"]  # requested change of it [m/s^2, rad/s^2]
    velocity: Float64[np.ndarray, " nj"]  # of joints, for contacts that come to rest [rad/s]
    rate: Float64[np.ndarray, " nj"]  # how fast that changes until they do [rad/s^2]
    beside: Float64[np.ndarray, " nj"]  # one for joints that move a contact, zero for others


class JointLimit(Limit):
    """Bounds on joint accelerations that keep position, velocity and acceleration limits.

    The bounds are the viability bounds of Del Prete ("Joint Position and Velocity Bounds in
    Discrete-Time Acceleration/Torque Control of Robot Manipulators", RA-L 2018): a joint may not
    go so fast that braking at b could no longer stop it before its limit. With s the distance to
    the upper limit, an acceleration a held for one horizon dt is viable if

        (v + a dt)^2 <= 2 b (s - v dt - a dt^2 / 2)         and     v + a dt <= v_max,

    of which the largest is the larger root

        a = sqrt(2 b (s - v dt / 2) / dt^2 + b^2 / 4) - (v / dt + b / 2).

    Where the joint has to be at rest sooner than dt, s < v dt / 2, that root would let it swing
    past the limit and return to it at dt; there a <= -v^2 / 2s.

    Position and velocity limits never make the problem infeasible: `lower <= upper` holds for
    every state. A joint that is beyond a limit is asked back within one horizon, as far as the
    acceleration limit allows. Where bounds contradict each other, as a position limit that needs
    harder braking than a velocity limit would have, both become the one that brakes.

    Torque controllers leave out of v what joints beside a contact do only because that still moves,
    and ask those joints for no more than `braking`, nor for `braking_of`, and near their limits for
    no more than it takes to stop within the margin: see `bound_settling`.

    Its settings are read-only: construct a new controller for another limit.

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
        acceleration_max: largest joint acceleration [rad/s^2].
        braking: deceleration with which a joint plans to stop before its position limit [rad/s^2].
        braking_of: the same of joints that stop otherwise than the rest, by joint name [rad/s^2].
        horizon: horizon dt of the bounds [s].
        position_margin: distance kept from the position limits [rad].
        velocity_scale: fraction of the robot's velocity limits that may be used.
        q_min: lower position limits, margin included; minus infinity where a joint is left to its
            own stop; known once bound to a robot, as those below [rad].
        q_max: upper position limits [rad].
        lower: lower bounds of the joint accelerations at the last state [rad/s^2].
        upper: upper bounds of the joint accelerations at the last state [rad/s^2].
        viability: inputs of the compiled bounds.
    """

    foreign = ("viability",)
    acceleration_max: float
    braking: float
    braking_of: Mapping[str, float]
    horizon: float
    position_margin: float
    velocity_scale: float
    q_min: Float64[np.ndarray, " nj"]
    q_max: Float64[np.ndarray, " nj"]
    lower: Float64[np.ndarray, " nj"]
    upper: Float64[np.ndarray, " nj"]
    viability: Viability

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
        name = "joint limit"
        most = checked_number(
            acceleration_max, f"acceleration_max of the {name} [rad/s^2]", above=0.0
        )
        brakes = {f"braking of the {name}": braking}
        brakes |= {f"braking of joint {joint!r}": b for joint, b in (braking_of or {}).items()}
        slowest, *others = [
            min(checked_number(b, f"{what} [rad/s^2]", above=0.0), most)
            for what, b in brakes.items()
        ]
        self._set(
            name=name,
            acceleration_max=most,
            braking=slowest,
            braking_of=dict(zip(braking_of or {}, others, strict=True)),
            horizon=checked_number(horizon, f"horizon of the {name} [s]", above=0.0),
            position_margin=checked_number(position_margin, f"position_margin of the {name} [rad]"),
            velocity_scale=checked_number(
                velocity_scale, f"velocity_scale of the {name}", above=0.0
            ),
        )
        self._position_range = dict(position_range or {})
        for joint, (lower, upper) in self._position_range.items():
            if not lower < upper:
                raise ConfigurationError(
                    f"position_range of joint {joint!r} in the joint limit is none",
                    got=(lower, upper),
                    wanted="lower < upper [rad]",
                )

    def _bind(self, robot: Robot) -> None:
        q_min, q_max = robot.q_min + self.position_margin, robot.q_max - self.position_margin
        for name, (lower, upper) in self._position_range.items():
            i = robot.joint_index(name)
            q_min[i], q_max[i] = max(q_min[i], lower), min(q_max[i], upper)
        crossed = np.flatnonzero(q_min >= q_max)
        if crossed.size:
            raise ConfigurationError(
                "position_margin and position_range of the joint limit leave joints no range: "
                + ", ".join(robot.joint_names[i] for i in crossed),
                got=self.position_margin,
                wanted="a smaller margin, or a wider range [rad]",
            )
        self._braking = np.full(robot.nj, self.braking)
        for name, b in self.braking_of.items():
            self._braking[robot.joint_index(name)] = b
        self._least, self._most = q_min.copy(), q_max.copy()
        self._set(q_min=q_min, q_max=q_max, lower=np.zeros(robot.nj), upper=np.zeros(robot.nj))

    def share_memory(self) -> None:
        """Make the memory of compiled code from the position limits in place."""
        if self._robot is not None:
            settings = [self.acceleration_max, self.horizon, self.position_margin]
            viability = Viability(
                q_min=self.q_min,
                q_max=self.q_max,
                v_max=self.velocity_scale * self._robot.v_max,
                braking=self._braking,
                gentle=np.minimum(self._braking, self.braking),
                settings=np.array(settings, dtype=np.float64),
            )
            self._set(viability=viability)

    def leave_to_stop(self, joint: int, *, at_lower: bool, at_upper: bool) -> None:
        """Suspend a position limit of a joint, or restore it; from the next tick on.

        For a joint that something else holds at the end of its range, as the ground does an ankle
        whose sole stands on an edge: the mechanical stop is there, and a limit that cannot be met
        would take it out on the rest of the robot. Limits of velocity and acceleration hold all the
        same.

        Args:
            joint: index among the robot's joints.
            at_lower: whether its lower limit is left to the stop.
            at_upper: whether its upper limit is.
        """
        self.q_min[joint] = -np.inf if at_lower else self._least[joint]
        self.q_max[joint] = np.inf if at_upper else self._most[joint]

    def evaluate(self, dynamics: Dynamics) -> None:
        """Fill in `lower` and `upper` for one state.

        Args:
            dynamics: the state, up to date.
        """
        nj = len(self.lower)
        bound(self.viability.address, dynamics.q[-nj:], dynamics.v[-nj:], self.lower, self.upper)

    def settling(
        self, lower: Float64[np.ndarray, " nj"], upper: Float64[np.ndarray, " nj"]
    ) -> Settling:
        """Return room for its bounds beside contacts, and the arrays that these are written to."""
        # Rows that a contact has at most, and joints.
        sizes = {"six": 6, "nj": len(lower)}
        return allocate(Settling, sizes, viability=self.viability, lower=lower, upper=upper)


@compiled
def bound(
    viability_at: int,
    q: Float64[np.ndarray, " nj"],
    v: Float64[np.ndarray, " nj"],
    lower: Float64[np.ndarray, " nj"],
    upper: Float64[np.ndarray, " nj"],
) -> None:
    """Write bounds of the accelerations of joints, in [-a_max, a_max], which never cross."""
    bound_joints(view(Viability, viability_at), q, v, lower, upper)


@part
def bound_joints(
    viability: Viability,
    q: Float64[np.ndarray, " nj"],
    v: Float64[np.ndarray, " nj"],
    lower: Float64[np.ndarray, " nj"],
    upper: Float64[np.ndarray, " nj"],
) -> None:
    """Write the bounds of all joints."""
    for i in range(len(q)):
        lower[i], upper[i] = _joint_bounds(viability, i, q[i], v[i], viability.braking[i])


@part
def _settings_of(viability: Viability) -> tuple[float, float, float]:
    """Acceleration limit, horizon and room between position limits and stops."""
    return viability.settings[0], viability.settings[1], viability.settings[2]


@part
def _joint_bounds(
    viability: Viability, i: int, q: float, v: float, braking: float
) -> tuple[float, float]:
    a_max, dt, _ = _settings_of(viability)
    settings = (a_max, dt, braking)
    below, above = q - viability.q_min[i], viability.q_max[i] - q
    return viable_bounds(below, above, v, viability.v_max[i], settings)


@part
def viable_bounds(
    below: float, above: float, v: float, v_max: float, settings: tuple[float, float, float]
) -> tuple[float, float]:
    """Least and largest acceleration between two limits; the one that brakes where they cross."""
    upper = largest_acceleration(above, v, v_max, settings)
    lower = -largest_acceleration(below, -v, v_max, settings)
    if lower > upper:
        lower = upper = upper if v > 0.0 else lower
    return lower, upper


@compiled
def largest_acceleration(
    s: float, v: float, v_max: float, settings: tuple[float, float, float]
) -> float:
    """The largest acceleration at a distance s from a limit; a_max, dt and b as in `JointLimit`."""
    a_max, dt, b = settings
    if s < 0.5 * v * dt:
        approach = max(v, 0.0)
        distance = max(s, 0.5 * _STOP_FRACTION * dt * approach + _TINY)
        # Beyond the limit: back to it at dt, counting the speed at which the joint returns already.
        back = (2.0 / (dt * dt)) * (min(s, 0.0) + dt * (approach - v))
        a = back - 0.5 * approach * approach / distance
    else:
        a = sqrt(2.0 * b * (s - 0.5 * v * dt) / (dt * dt) + 0.25 * b * b) - (v / dt + 0.5 * b)
    return max(-a_max, min(a, (v_max - v) / dt, a_max))


@part
def _braking_asked(s: float, v: float, b: float, viability: Viability) -> float:
    """The most that a joint beside a contact is asked to brake by, or to come back from a limit.

    Such a joint brakes the body. It stops within the distance to the limit, or within the margin if
    that is less,

        min(b, v^2 / 2 max(s, m) + 2 max(-s, 0) / (10 dt)^2),

    and comes back slowly: at 0.05 rad/s, which noise shows, it brakes by 0.13 rad/s^2 and not
    by 5, and 2 mrad beyond the limit by 0.1 and not by 8, with the defaults.
    """
    approach = max(v, 0.0)
    _, dt, margin = _settings_of(viability)
    distance = max(s, margin, 0.5 * _STOP_FRACTION * dt * approach, _TINY)
    back = _RETURN * dt
    return min(b, 0.5 * approach * approach / distance + 2.0 / (back * back) * max(-s, 0.0))


@part
def bound_settling(state: StateNumbers, assembly: StackNumbers, room: Settling) -> None:
    """Leave out of joint limits what joints do only because a contact still moves.

    A contact that carries comes to rest by itself, J dv + drift = a - d J v. A sole that has come
    down on an edge turns by several rad/s until it lies, and its ankle with it: an ankle that shall
    stop before its limit could do so sooner by the body alone, which would be thrown aside by 40
    m/s^2 for it. So, with w the least velocity of the joints between base and contact that moves it
    as it moves, J w = J v,

        lower(v - w) + r <= dv <= upper(v - w) + r,  r the least with J r = a - d J v

    where lower and upper are the bounds of `JointLimit`, but with its `braking` b for all of these
    joints, and never so that a joint has to brake, or to come back from beyond its limit, by more
    than `_braking_asked`: nothing but the body could do that beside a contact that holds, and it
    would take the robot off its soles. An ankle at its limit on a bump, asked for b at readings of
    3 mrad beyond it, kicked G1 until it hopped. Where an ankle's sole is tilted beyond its range
    the joint's own stop holds it.
    """
    q, v, viability = state.q, state.v, room.viability
    first, angles = len(v) - len(room.lower), len(q) - len(room.lower)
    for i in range(len(room.lower)):
        room.velocity[i] = room.rate[i] = room.beside[i] = 0.0
    for i in range(assembly.owners.contacts):
        _settle(state, assembly, line_of(assembly.owners, i), first, room)
    for i in range(len(room.lower)):
        if room.beside[i] > 0.0:
            still, b, at = v[first + i] - room.velocity[i], viability.gentle[i], q[angles + i]
            lower, upper = _joint_bounds(viability, i, at, still, b)
            least = _braking_asked(at - viability.q_min[i], -still, b, viability)
            most = _braking_asked(viability.q_max[i] - at, still, b, viability)
            room.lower[i] = min(lower, least) + room.rate[i]
            room.upper[i] = max(upper, -most) + room.rate[i]


@part
def _settle(
    state: StateNumbers, assembly: StackNumbers, line: Line, first: int, room: Settling
) -> None:
    """Add what one contact's motion asks of its joints: w = J^T (J J^T + s I)^-1 J v, so r."""
    v, owners, rows = state.v, assembly.owners, assembly.rows
    columns, top, count = owners.frames.columns, rows.first + line.first, line.dim
    begin, end = owners.frames.starts[line.frame], owners.frames.starts[line.frame + 1]
    for i in range(count):
        room.slip[i] = 0.0
        for k in range(begin, end):
            room.slip[i] += rows.matrix[top + i, columns[k]] * v[columns[k]]
        for j in range(i + 1):
            total = _SINGULAR if i == j else 0.0
            for k in range(begin, end):
                if columns[k] >= first:
                    total += rows.matrix[top + i, columns[k]] * rows.matrix[top + j, columns[k]]
            room.gram[i, j] = total
    if not factor_leading(room.gram, count):
        return
    for i in range(count):
        asks = owners.parameters[line.start + 4 + 2 * count + i]
        room.change[i] = asks - owners.parameters[line.start] * room.slip[i]
    solve_leading(room.gram, count, room.slip)
    solve_leading(room.gram, count, room.change)
    for k in range(begin, end):
        joint = columns[k] - first
        if joint >= 0:
            for i in range(count):
                room.velocity[joint] += rows.matrix[top + i, columns[k]] * room.slip[i]
                room.rate[joint] += rows.matrix[top + i, columns[k]] * room.change[i]
            room.beside[joint] = 1.0
