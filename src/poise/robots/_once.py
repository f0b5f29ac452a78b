"""`once_a_robot`: cache of values that depend on a robot alone."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from poise.robots._robot import Robot

Made = TypeVar("Made")


def once_a_robot(make: Callable[[Robot], Made]) -> Callable[[Robot], Made]:
    """Keep what a function makes of a robot, which must not hold it, for as long as it lives."""
    made: WeakKeyDictionary[Robot, Made] = WeakKeyDictionary()

    @wraps(make)
    def find(robot: Robot) -> Made:
        if robot not in made:
            made[robot] = make(robot)
        return made[robot]

    return find
