"""`LedJoints`: joints that follow tasks of their own, independent of all others."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float64, Int64

from poise.control._differential_ik._bounds import VelocityBounds
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import JointTask, Stack, Task


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
