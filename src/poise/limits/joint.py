"""`JointLimit`: position, velocity and acceleration limits as one pair of acceleration bounds."""

import numpy as np
from jaxtyping import Float64

from poise.contacts.contact import checked_number
from poise.dynamics.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.robots.robot import Robot


class JointLimit:
    """Bounds on joint accelerations that keep position, velocity and acceleration limits.

    The bounds are the viability bounds of Del Prete ("Joint Position and Velocity Bounds in
    Discrete-Time Acceleration/Torque Control of Robot Manipulators", RA-L 2018): a joint may not
    go so fast that full braking could no longer stop it before its limit. With s the distance to
    the upper limit after one horizon dt of coasting, an acceleration a is viable if

        (qd + a dt)^2 <= 2 a_max (s - a dt^2 / 2)     and     qd + a dt <= v_max.

    Position and velocity limits never make the problem infeasible: `lower <= upper` holds for
    every state. A joint that is already beyond a limit is asked to come back as hard as the
    acceleration limit allows, and both bounds meet there.

    Args:
        acceleration_max: largest joint acceleration [rad/s^2].
        horizon: dt, longer than the control period so that braking starts smoothly [s].
        position_margin: distance kept from the position limits [rad].
        velocity_scale: share of the robot's velocity limits that may be used.

    Attributes:
        name: what reports call it.
        lower: lower bounds of the joint accelerations at the last state [rad/s^2].
        upper: upper bounds.
    """

    def __init__(
        self,
        *,
        acceleration_max: float = 200.0,
        horizon: float = 0.02,
        position_margin: float = 0.01,
        velocity_scale: float = 1.0,
    ) -> None:
        self.name = "joint limit"
        self.acceleration_max = checked_number(
            acceleration_max, "acceleration_max of the joint limit [rad/s^2]", above=0.0
        )
        self.horizon = checked_number(horizon, "horizon of the joint limit [s]", above=0.0)
        self.position_margin = checked_number(
            position_margin, "position_margin of the joint limit [rad]"
        )
        self.velocity_scale = checked_number(
            velocity_scale, "velocity_scale of the joint limit", above=0.0
        )

    def bind(self, robot: Robot) -> None:
        """Takes the limits of a robot; controllers call it before the first tick.

        Raises:
            ConfigurationError: the margin leaves a joint no range.
        """
        q_min, q_max = robot.q_min + self.position_margin, robot.q_max - self.position_margin
        crossed = np.flatnonzero(q_min >= q_max)
        if crossed.size:
            raise ConfigurationError(
                "position_margin of the joint limit leaves joints no range: "
                + ", ".join(robot.joint_names[i] for i in crossed),
                got=self.position_margin,
                wanted="a smaller margin [rad]",
            )
        self._q_slice = slice(robot.nq - robot.nj, robot.nq)
        self._v_slice = slice(robot.base_dofs, robot.nv)
        # Upper limits first, lower limits mirrored behind them: one pass serves both.
        self._q_bound = np.concatenate((q_max, -q_min))
        self._v_bound = self.velocity_scale * np.concatenate((robot.v_max, robot.v_max))
        self._q = np.empty(2 * robot.nj)
        self._v = np.empty(2 * robot.nj)
        self.lower: Float64[np.ndarray, "nj"] = np.zeros(robot.nj)
        self.upper: Float64[np.ndarray, "nj"] = np.zeros(robot.nj)

    def evaluate(self, dynamics: Dynamics) -> None:
        """Fills `lower` and `upper` for one state.

        Args:
            dynamics: the state, up to date.
        """
        nj = len(self.upper)
        q, v = dynamics.state.q[self._q_slice], dynamics.state.v[self._v_slice]
        self._q[:nj], self._q[nj:] = q, -q
        self._v[:nj], self._v[nj:] = v, -v
        bound = largest_viable_acceleration(
            self._q, self._v, self._q_bound, self._v_bound, self.acceleration_max, self.horizon
        )
        # Both at once can only cross where a joint breaks two limits; then braking wins.
        self.upper[:] = bound[:nj]
        np.negative(bound[nj:], out=self.lower)
        crossed = self.lower > self.upper
        if crossed.any():
            middle = 0.5 * (self.lower[crossed] + self.upper[crossed])
            self.lower[crossed] = self.upper[crossed] = middle


def largest_viable_acceleration(
    q: Float64[np.ndarray, "m"],
    v: Float64[np.ndarray, "m"],
    q_max: Float64[np.ndarray, "m"],
    v_max: Float64[np.ndarray, "m"],
    a_max: float,
    dt: float,
) -> Float64[np.ndarray, "m"]:
    """Largest acceleration after which a joint can still stop before its upper limit.

    Solves dt^2 a^2 + dt (2 v + a_max dt) a + v^2 - 2 a_max (q_max - q - v dt) = 0 for its larger
    root; where there is none, the joint must at least brake to a stop.

    Args:
        q: positions [rad].
        v: velocities [rad/s].
        q_max: upper position limits [rad].
        v_max: upper velocity limits [rad/s].
        a_max: acceleration limit [rad/s^2].
        dt: horizon [s].

    Returns:
        Upper bounds in [-a_max, a_max] [rad/s^2].
    """
    b = dt * (2.0 * v + a_max * dt)
    c = v * v - 2.0 * a_max * (q_max - q - v * dt)
    discriminant = b * b - 4.0 * dt * dt * c
    root = (np.sqrt(np.maximum(discriminant, 0.0)) - b) / (2.0 * dt * dt)
    # The parabola counts speed in either direction; towards the limit only speed beyond zero is
    # unsafe, so coming to rest is always allowed.
    stop = -v / dt
    viable = np.where(discriminant >= 0.0, np.maximum(root, stop), stop)
    # Where even resting breaks the position limit, the joint has to come back.
    beyond = q + 0.5 * v * dt >= q_max
    back = 2.0 * (q_max - q - v * dt) / (dt * dt)
    viable = np.where(beyond, np.minimum(viable, back), viable)
    viable = np.minimum(viable, (v_max - v) / dt)
    return np.clip(viable, -a_max, a_max)
