"""`velocity_problem`: prioritised joint velocities as a hierarchical problem; and its bounds."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise.hqp import HierarchicalProblem, Level
from poise.robots import Robot
from poise.stack import JointLimit


def velocity_problem(
    tasks: Sequence[Level], lower: Float64[np.ndarray, " n"], upper: Float64[np.ndarray, " n"]
) -> HierarchicalProblem:
    """Joint limits first, then tasks, then the least velocity.

    Args:
        tasks: rows J u = v, most important first.
        lower: of the velocities [rad/s]; -inf where there is no bound.
        upper: likewise.
    """
    n = len(lower)
    limits = Level(np.zeros((0, n)), 0.0, 0.0, name="joint limits")
    return HierarchicalProblem([limits, *tasks], None, None, lower, upper)


def velocity_bounds(
    robot: Robot, q: Float64[np.ndarray, " n"], limit: JointLimit, limit_time: float
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """Least and greatest joint velocities that keep position and velocity limits [rad/s].

    Args:
        robot: whose joints.
        q: their angles [rad].
        limit: position margin and velocity scale.
        limit_time: in this time no joint may go farther than its limit [s].
    """
    v_max = limit.velocity_scale * robot.v_max
    lower = (robot.q_min + limit.position_margin - q) * (1.0 / limit_time)
    upper = (robot.q_max - limit.position_margin - q) * (1.0 / limit_time)
    return np.clip(lower, -v_max, v_max), np.clip(upper, -v_max, v_max)


def equalities(
    name: str, J: Float64[np.ndarray, "m n"], velocity: Float64[np.ndarray, " m"]
) -> Level:
    """A task J u = velocity.

    Args:
        name: of the level.
        J: Jacobian.
        velocity: what is wanted.
    """
    return Level(J, velocity, velocity, name=name, labels=name)
