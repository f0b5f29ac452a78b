"""`limit_weights`: Chan and Dubey's weights of joints near their limits.

`VelocityBounds`: position and velocity limits as one pair of velocity bounds.
`LedJoints`: joints that follow tasks of their own, independent of all others.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float64, Int64

from poise._compiled import compiled
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import JointLimit, JointTask, Stack, Task


class VelocityBounds:
    """Bounds on joint velocities that keep position and velocity limits.

    In a time T, the control period or longer, no joint may go farther than its limit,

        (q_min - q) / T <= u <= (q_max - q) / T     and     |u| <= v_max

    so that it slows down before a limit with T as time constant and returns from beyond with the
    same. Bounds never cross: a joint far beyond a limit returns at v_max. Limits are those of the
    stack's `JointLimit`, with its velocity scale.

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
        self.q_min: Float64[np.ndarray, " n"] = limit.q_min[joints]
        self.q_max: Float64[np.ndarray, " n"] = limit.q_max[joints]
        self.v_max: Float64[np.ndarray, " n"] = limit.velocity_scale * robot.v_max[joints]
        self._rate = 1.0 / limit_time

    def at(
        self, q: Float64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
        """Return lower and upper bounds [rad/s] at positions of these joints [rad]."""
        v_max = self.v_max
        lower = np.maximum(np.minimum((self.q_min - q) * self._rate, v_max), -v_max)
        upper = np.maximum(np.minimum((self.q_max - q) * self._rate, v_max), -v_max)
        return lower, upper


LARGEST_WEIGHT = 1e4
"""Weight of a joint at or beyond a limit that moves outwards: it moves a hundredth as far, and the
weight is still a number to divide by."""


def limit_weights(
    q: Float64[np.ndarray, " n"],
    rate: Float64[np.ndarray, " n"],
    q_min: Float64[np.ndarray, " n"],
    q_max: Float64[np.ndarray, " n"],
) -> Float64[np.ndarray, " n"]:
    """Return the diagonal of W_B: above one for a joint that moves towards its nearer limit.

    Equation (23) of Zhang and Kikuuwe, after Chan and Dubey 1995,

        W_B = (q_max - q_min)^2 / (4 (q_max - q) (q - q_min))    moving away from the middle
        W_B = 1                                                  moving towards it, or at rest

    which goes to infinity at the limit and is undefined beyond it. Here it ends at
    `LARGEST_WEIGHT`, which also holds beyond a limit for a joint that moves further out.
    """
    weight = np.empty(len(q))
    _weigh(q, rate, q_min, q_max, weight)
    return weight


@compiled
def _weigh(
    q: Float64[np.ndarray, " n"],
    rate: Float64[np.ndarray, " n"],
    q_min: Float64[np.ndarray, " n"],
    q_max: Float64[np.ndarray, " n"],
    weight: Float64[np.ndarray, " n"],
) -> None:
    """Evaluate (23), see `limit_weights`."""
    for i in range(len(q)):
        above, below, span = q[i] - q_min[i], q_max[i] - q[i], q_max[i] - q_min[i]
        square, room = span * span, 4.0 * above * below
        if (above - below) * rate[i] <= 0.0:
            weight[i] = 1.0
        elif room * LARGEST_WEIGHT > square:
            weight[i] = square / room
        else:
            weight[i] = LARGEST_WEIGHT


class LedJoints:
    """Joints whose velocities are known before the solve: those of some joint tasks.

    Such tasks stand alone in the lowest levels and have no rows on the joints that are solved for;
    the effect of these joints on other tasks is taken off their velocities.

    Attributes:
        index: the robot's joints, in the order of the tasks' rows.
        levels: number of levels of the stack that are theirs.
        held: True for joints that are held at their limits.
    """

    def __init__(self, robot: Robot, stack: Stack, names: Sequence[str], limit_time: float) -> None:
        for name in names:
            _check_kind(stack.task(name))
        self.levels = _lowest_levels(stack, names)
        joints = [
            robot.joint_index(joint)
            for _, task in stack.tasks()
            if task.name in names and isinstance(task, JointTask)
            for joint in task.joints or robot.joint_names
        ]
        if len(set(joints)) != len(joints):
            raise ConfigurationError("tasks lead a joint twice", got=list(names))
        self.index: Int64[np.ndarray, " k"] = np.array(joints, dtype=np.int64)
        self._places = self.index + (robot.nq - robot.nj)
        self._bounds = VelocityBounds(robot, stack.joint_limit, limit_time, self.index)
        self.held: Bool[np.ndarray, " k"] = np.zeros(len(joints), dtype=np.bool_)

    def within_limits(
        self, asked: Float64[np.ndarray, " k"], q: Float64[np.ndarray, " nq"]
    ) -> Float64[np.ndarray, " k"]:
        """Return their velocities [rad/s]."""
        lower, upper = self._bounds.at(q[self._places])
        self.held = (asked < lower) | (asked > upper)
        return np.minimum(np.maximum(asked, lower), upper)


def _check_kind(task: Task) -> None:
    if not isinstance(task, JointTask):
        raise ConfigurationError(
            f"task {task.name!r} cannot lead joints", got=type(task).__name__, wanted="a JointTask"
        )


def _lowest_levels(stack: Stack, names: Sequence[str]) -> int:
    """Count the levels that the tasks of these names have for themselves, at the end."""
    levels = [[task.name in names for task in level] for level in stack.levels]
    count = sum(any(level) for level in levels)
    first = len(levels) - count
    if count and not all(all(level) for level in levels[first:]):
        raise ConfigurationError(
            "tasks that lead joints do not stand alone in the lowest levels",
            got=[[task.name for task in level] for level in stack.levels],
            wanted=f"{list(names)} in levels of their own, below all others",
        )
    return count
