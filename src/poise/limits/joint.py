"""`JointLimit`: position, velocity and acceleration limits as one pair of acceleration bounds."""

import math

import numpy as np
from jaxtyping import Float64

from poise.checks import checked_number
from poise.dynamics.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.robots.robot import Robot

_STOP_SHARE = 0.1
"""Share of the horizon in which a joint about to pass its limit stops.

It bounds the braking gain near the limit, where v^2 / 2s would turn measurement noise into full
braking. The price is that a joint may pass its limit by `a_max (share dt)^2 / 2`, 0.4 mrad with the
defaults, which the position margin is there for."""

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

    Args:
        acceleration_max: largest joint acceleration [rad/s^2].
        braking: deceleration b with which a joint plans to stop before its position limit, at most
            `acceleration_max`; low, so that braking starts early and does not jerk the robot
            [rad/s^2].
        horizon: dt, at least twice the control period so that braking starts smoothly [s].
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
        braking: float = 8.0,
        horizon: float = 0.02,
        position_margin: float = 0.01,
        velocity_scale: float = 1.0,
    ) -> None:
        self.name = "joint limit"
        self.acceleration_max = checked_number(
            acceleration_max, "acceleration_max of the joint limit [rad/s^2]", above=0.0
        )
        self.braking = min(
            checked_number(braking, "braking of the joint limit [rad/s^2]", above=0.0),
            self.acceleration_max,
        )
        self.horizon = checked_number(horizon, "horizon of the joint limit [s]", above=0.0)
        self.position_margin = checked_number(
            position_margin, "position_margin of the joint limit [rad]"
        )
        self.velocity_scale = checked_number(
            velocity_scale, "velocity_scale of the joint limit", above=0.0
        )
        self._robot: Robot | None = None

    def bind(self, robot: Robot) -> None:
        """Takes the limits of a robot; controllers call it before the first tick.

        Raises:
            ConfigurationError: the margin leaves a joint no range, or the limit serves another
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
        self.lower: Float64[np.ndarray, " nj"] = np.zeros(robot.nj)
        self.upper: Float64[np.ndarray, " nj"] = np.zeros(robot.nj)
        self._robot = robot

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
            self._q,
            self._v,
            self._q_bound,
            self._v_bound,
            self.acceleration_max,
            self.horizon,
            self.braking,
        )
        self.upper[:] = bound[:nj]
        np.negative(bound[nj:], out=self.lower)
        crossed = self.lower > self.upper
        if crossed.any():
            braking = np.where(v > 0.0, self.upper, self.lower)
            self.lower[crossed] = self.upper[crossed] = braking[crossed]


def largest_viable_acceleration(
    q: Float64[np.ndarray, " m"],
    v: Float64[np.ndarray, " m"],
    q_max: Float64[np.ndarray, " m"],
    v_max: Float64[np.ndarray, " m"],
    a_max: float,
    dt: float,
    braking: float,
) -> Float64[np.ndarray, " m"]:
    """Largest acceleration after which a joint can still stop before its upper limit.

    With s = q_max - q this is the larger root of

        dt^2 a^2 + dt (2 v + b dt) a + v^2 - 2 b (s - v dt) = 0

    as long as the joint may still move towards the limit at dt, that is for s >= v dt / 2. Nearer
    to it the joint must be at rest sooner, which takes -v^2 / 2s; the root would let it swing past
    the limit and return to it at dt.

    Args:
        q: positions [rad].
        v: velocities [rad/s].
        q_max: upper position limits [rad].
        v_max: upper velocity limits [rad/s].
        a_max: acceleration limit [rad/s^2].
        dt: horizon [s].
        braking: b, the deceleration that stopping is planned with [rad/s^2].

    Returns:
        Upper bounds in [-a_max, a_max] [rad/s^2].
    """
    s = q_max - q
    # The discriminant is 8 b dt^2 times (this margin plus b dt^2 / 8).
    margin = s - (0.5 * dt) * v
    rest = v * (1.0 / dt)
    viable = margin + 0.125 * braking * dt * dt
    np.maximum(viable, 0.0, out=viable)
    np.sqrt(viable, out=viable)
    viable *= math.sqrt(2.0 * braking) / dt
    viable -= rest
    viable -= 0.5 * braking
    if margin.min(initial=0.0) < 0.0:
        near = margin < 0.0
        viable[near] = _stop_at_once(s[near], v[near], dt)
    np.minimum(viable, v_max * (1.0 / dt) - rest, out=viable)
    np.minimum(viable, a_max, out=viable)
    return np.maximum(viable, -a_max, out=viable)


def _stop_at_once(
    s: Float64[np.ndarray, " k"], v: Float64[np.ndarray, " k"], dt: float
) -> Float64[np.ndarray, " k"]:
    """What joints that are within half a horizon of their limit, or beyond it, may do."""
    approach = np.maximum(v, 0.0)
    distance = np.maximum(s, 0.5 * _STOP_SHARE * dt * approach + _TINY)
    stop = -0.5 * approach * approach / distance
    # Beyond the limit: back to it at dt, counting the speed at which the joint returns already.
    return stop + (2.0 / (dt * dt)) * (np.minimum(s, 0.0) + dt * (approach - v))
