"""`JointLimit`: position, velocity and acceleration limits as one pair of acceleration bounds."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise._copies import Copied
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack._viability import Viability, ViableAcceleration


class JointLimit(Copied):
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
    and ask those joints for no more than `braking`, nor for `braking_of`, and near their limits for
    no more than it takes to stop within the margin: see `bound_settling`.

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

    foreign = ("_viable",)

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
        """Lower position limits, margin included; known once bound to a robot [rad].

        Minus infinity where a joint is left to its own stop.
        """
        return self._q_min

    @property
    def q_max(self) -> Float64[np.ndarray, " nj"]:
        """Upper position limits, margin included; known once bound to a robot [rad].

        Infinity where a joint is left to its own stop.
        """
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
        """Take the limits of a robot; controllers call it before the first tick.

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
        self._least, self._most = q_min.copy(), q_max.copy()
        crossed = np.flatnonzero(q_min >= q_max)
        if crossed.size:
            raise ConfigurationError(
                "position_margin and position_range of the joint limit leave joints no range: "
                + ", ".join(robot.joint_names[i] for i in crossed),
                got=self._position_margin,
                wanted="a smaller margin, or a wider range [rad]",
            )
        self._q_slice = slice(robot.nq - robot.nj, robot.nq)
        self._v_slice = slice(robot.base_dofs, robot.nv)
        self._lower: Float64[np.ndarray, " nj"] = np.zeros(robot.nj)
        self._upper: Float64[np.ndarray, " nj"] = np.zeros(robot.nj)
        self._robot = robot
        self.share_memory()

    def share_memory(self) -> None:
        """Make the bounds from the position limits in place."""
        robot = self._robot
        if robot is None:
            return
        braking = np.full(robot.nj, self._braking)
        for name, b in self._braking_of.items():
            braking[robot.joint_index(name)] = b
        self._viable = ViableAcceleration(
            self._q_min,
            self._q_max,
            self._velocity_scale * robot.v_max,
            a_max=self._acceleration_max,
            dt=self._horizon,
            braking=braking,
            margin=self._position_margin,
            gentle=np.minimum(braking, self._braking),
        )

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
        self._q_min[joint] = -np.inf if at_lower else self._least[joint]
        self._q_max[joint] = np.inf if at_upper else self._most[joint]

    def evaluate(self, dynamics: Dynamics) -> None:
        """Fill in `lower` and `upper` for one state.

        Args:
            dynamics: the state, up to date.
        """
        q, v = dynamics.q[self._q_slice], dynamics.v[self._v_slice]
        self._viable.bounds(q, v, self._lower, self._upper)

    @property
    def viability(self) -> Viability:
        """Inputs of the bounds; known once bound to a robot."""
        return self._viable.viability
