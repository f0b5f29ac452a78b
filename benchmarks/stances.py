"""`bench_stack`: the tasks that a benchmark times, on two feet or on one."""

from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import FrameTask, PostureTask, Stack, Task, default_stack

STANCES = ("double", "single")
"""Feet on the ground: both, or the right one."""

STACKS = ("table1", "default")
"""Stacks: the four levels of the paper's table, or Poise's own with a posture level."""


def swing_sole(robot: Robot) -> str:
    """The sole that is in the air in single support: the left one."""
    return next(iter(robot.soles))


def support_sole(robot: Robot) -> str:
    """The sole that stays on the ground in single support: the right one."""
    return list(robot.soles)[1]


def check_biped(robot: Robot) -> None:
    """Refuses a robot that cannot stand on two soles.

    Raises:
        ConfigurationError: a fixed base, or fewer than two soles.
    """
    if not robot.floating_base or len(robot.soles) < 2:
        raise ConfigurationError(
            "a benchmark of a standing robot needs a floating base and two soles",
            got=robot.name,
            wanted="a biped, such as humanoid33 or g1",
        )


def bench_stack(robot: Robot, kind: str, stance: str) -> Stack:
    """A new stack: the levels to time.

    "table1" is Table 1 of Ahn et al. 2024: dynamics and torque limits; contacts, wrench cones and
    acceleration limits; COM and pelvis orientation; poses of the end effectors. "default" is
    `default_stack`, which adds the torso's orientation and, below everything, a level with the
    posture of all joints. In single support the swing foot is one more end effector.

    Args:
        robot: a biped, see `check_biped`.
        kind: one of `STACKS`.
        stance: one of `STANCES`.
    """
    base = default_stack(robot)
    levels = [list(level) for level in base.levels]
    if kind == "table1":
        levels = [[task for task in level if not _is_extra(task, robot)] for level in levels]
        levels = [level for level in levels if level]
    contacts = list(base.contacts)
    if stance == "single":
        contacts = [c for c in contacts if c.frame != swing_sole(robot)]
        swing = FrameTask(swing_sole(robot), kp=100.0)
        # With the hands, second in importance to balance; alone there on a robot without hands.
        if len(levels) > 1 and not isinstance(levels[1][0], PostureTask):
            levels[1].append(swing)
        else:
            levels.insert(1, [swing])
    return Stack(contacts, levels)


def _is_extra(task: Task, robot: Robot) -> bool:
    """What the default stack has and the paper's table has not."""
    turns_torso = isinstance(task, FrameTask) and task.frame == robot.torso != robot.pelvis
    return isinstance(task, PostureTask) or turns_torso
