"""`Controller`: what every controller can be asked, whatever is inside."""

from typing import Protocol, runtime_checkable

from poise.control._command import Command
from poise.control._status import ControllerStatus
from poise.dynamics import RobotState
from poise.robots import Robot
from poise.stack import Stack, Task


@runtime_checkable
class Controller(Protocol):
    """From a state to a command, tick by tick.

    Attributes:
        timings: how long the phases of the last tick took: dynamics, assembly, solve, command [s].
    """

    timings: dict[str, float]

    @property
    def robot(self) -> Robot:
        """The robot."""
        ...

    @property
    def stack(self) -> Stack:
        """Contacts, limits and tasks."""
        ...

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stands in for at the last tick."""
        ...

    @property
    def size(self) -> tuple[int, int]:
        """Variables and rows of the last tick's problem."""
        ...

    def step(self, state: RobotState) -> Command:
        """One tick; never raises."""
        ...

    def reset(self) -> None:
        """Forgets the past."""
        ...

    def status(self) -> ControllerStatus:
        """How each task stood at the last tick."""
        ...
