"""`VelocityBounds`: position and velocity limits as one pair of velocity bounds."""

import numpy as np
from jaxtyping import Float64

from poise.limits.joint import JointLimit
from poise.robots.robot import Robot

RETURN_TIME = 0.1
"""Time constant with which a joint beyond its limit comes back [s]; in one period it would jerk,
and encoder noise over a period is a large velocity."""


class VelocityBounds:
    """Bounds on joint velocities that keep position and velocity limits.

        max(-v_max, (q_min - q) / dt) <= u <= min(v_max, (q_max - q) / dt)

    A joint beyond a limit may only come back, and does, at its distance over `RETURN_TIME`. Bounds
    never cross. Limits are those of the robot, narrowed by the margin and the velocity scale of the
    stack's `JointLimit`.

    Args:
        robot: the robot.
        limit: position margin and velocity scale.
        dt: control period [s].

    Attributes:
        q_min: lower position limits, margin included [rad].
        q_max: upper position limits.
        v_max: velocity limits [rad/s].
    """

    def __init__(self, robot: Robot, limit: JointLimit, dt: float) -> None:
        self.q_min: Float64[np.ndarray, " nj"] = robot.q_min + limit.position_margin
        self.q_max: Float64[np.ndarray, " nj"] = robot.q_max - limit.position_margin
        self.v_max: Float64[np.ndarray, " nj"] = limit.velocity_scale * robot.v_max
        self._dt, self._return_time = dt, max(dt, RETURN_TIME)

    def at(
        self, q: Float64[np.ndarray, " nj"]
    ) -> tuple[Float64[np.ndarray, " nj"], Float64[np.ndarray, " nj"]]:
        """Lower and upper bounds [rad/s] at joint positions [rad]."""
        return -self._towards(q - self.q_min), self._towards(self.q_max - q)

    def _towards(self, room: Float64[np.ndarray, " nj"]) -> Float64[np.ndarray, " nj"]:
        """Fastest velocity towards a limit that is `room` away."""
        fastest = room / self._dt
        beyond = room < 0.0
        if beyond.any():
            fastest[beyond] = room[beyond] / self._return_time
        return np.minimum(self.v_max, np.maximum(-self.v_max, fastest))
