"""`VelocityBounds`: position and velocity limits as one pair of velocity bounds."""

import numpy as np
from jaxtyping import Float64, Int64

from poise.limits.joint import JointLimit
from poise.robots.robot import Robot


class VelocityBounds:
    """Bounds on joint velocities that keep position and velocity limits.

    In a time T, the control period or longer, no joint may go farther than its limit,

        (q_min - q) / T <= u <= (q_max - q) / T     and     |u| <= v_max

    so that it slows down before a limit with T as time constant and, beyond it, comes back with the
    same. Bounds never cross: a joint that is beyond a limit by far comes back at v_max. Limits are
    those of the robot, narrowed by the margin and the velocity scale of the stack's `JointLimit`.

    Args:
        robot: the robot.
        limit: position margin and velocity scale.
        limit_time: T [s].
        joints: indices of the joints that may move.

    Attributes:
        q_min: lower position limits, margin included [rad].
        q_max: upper position limits.
        v_max: velocity limits [rad/s].
    """

    def __init__(
        self,
        robot: Robot,
        limit: JointLimit,
        limit_time: float,
        joints: Int64[np.ndarray, " n"],
    ) -> None:
        self.q_min: Float64[np.ndarray, " n"] = robot.q_min[joints] + limit.position_margin
        self.q_max: Float64[np.ndarray, " n"] = robot.q_max[joints] - limit.position_margin
        self.v_max: Float64[np.ndarray, " n"] = limit.velocity_scale * robot.v_max[joints]
        self._slowest = -self.v_max
        self._rate = 1.0 / limit_time

    def at(
        self, q: Float64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
        """Lower and upper bounds [rad/s] at positions of these joints [rad]."""
        return self._slow((self.q_min - q) * self._rate), self._slow((self.q_max - q) * self._rate)

    def _slow(self, velocity: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        return np.minimum(np.maximum(velocity, self._slowest), self.v_max)
