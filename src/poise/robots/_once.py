"""`once_a_robot`: what depends on a robot alone is made once for it."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from poise.robots._robot import Robot

Made = TypeVar("Made")


def once_a_robot(make: Callable[[Robot], Made]) -> Callable[[Robot], Made]:
    """Keeps what a function makes of a robot for as long as that robot lives.

    What is made must not hold the robot, or neither is ever let go; nor is it to be changed.

    Args:
        make: makes it.
    """
    made: WeakKeyDictionary[Robot, Made] = WeakKeyDictionary()

    @wraps(make)
    def find(robot: Robot) -> Made:
        if robot not in made:
            made[robot] = make(robot)
        return made[robot]

    return find
