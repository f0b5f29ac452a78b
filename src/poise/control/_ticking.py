"""`TickingController`: the tick that all controllers have in common, however they solve it."""

from abc import ABC, abstractmethod
from time import perf_counter
from typing import Generic, TypeVar

from poise._checks import checked_kind
from poise.control._command import Command, CommandStatus
from poise.control._state_check import is_usable
from poise.control._status import ControllerStatus, task_statuses
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.stack import Stack, Task, default_stack

A = TypeVar("A")


class TickingController(ABC, Generic[A]):
    """Checks the state, brings dynamics and contacts up to date, and has a subclass do the rest.

    A subclass writes rows, solves them for an answer of its own kind, and makes that a command.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks; `default_stack(robot)` when None.

    Attributes:
        robot: the robot.
        stack: contacts, limits and tasks.
        dynamics: of the last tick's state.
        timings: seconds that the four parts of the last tick took: dynamics, assembly, solve,
            command.

    Raises:
        PoiseError: a name that the robot does not have.
    """

    def __init__(self, robot: Robot, stack: Stack | None) -> None:
        self.robot = checked_kind(robot, Robot, "the controller's robot")
        stack = default_stack(robot) if stack is None else stack
        self.stack = checked_kind(stack, Stack, "the controller's stack")
        self.stack.bind(robot)
        self.dynamics = Dynamics(robot)
        self.timings: dict[str, float] = {}
        self._last_status = CommandStatus.OK

    @property
    @abstractmethod
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stands in for at the last tick."""

    def step(self, state: RobotState) -> Command:
        """One tick: from state to command.

        Args:
            state: the robot's state.

        Returns:
            What the joints should do, with the status that says how it came about.
        """
        usable = is_usable(state, self.robot)
        command = self._tick(state) if usable else self._safe(CommandStatus.BAD_STATE, state)
        self._last_status = command.status
        return command

    def reset(self) -> None:
        """Forgets the last command, the last solution and targets taken from the robot.

        Contacts stay as loaded as they are.
        """
        self._last_status = CommandStatus.OK
        for _, task in self.stack.tasks():
            task.reset()

    def status(self) -> ControllerStatus:
        """How each task stood at the last tick: level, error with unit, residual."""
        return ControllerStatus(
            command=self._last_status,
            tasks=task_statuses(self.stack, self._task_residuals(), self.suspended),
            explanation=self._explain(),
        )

    def _tick(self, state: RobotState) -> Command:
        begin = perf_counter()
        self.dynamics.update(state)
        for contact in self.stack.contacts:
            contact.advance(state.time)
        for task in self._switch():
            # A foot that landed holds its place when it is free again, not where it once was.
            task.reset()
        after_dynamics = perf_counter()
        self._assemble()
        after_assembly = perf_counter()
        answer = self._solve()
        after_solve = perf_counter()
        command = self._command(answer, state)
        self.timings = {
            "dynamics": after_dynamics - begin,
            "assembly": after_assembly - after_dynamics,
            "solve": after_solve - after_assembly,
            "command": perf_counter() - after_solve,
        }
        return command

    @abstractmethod
    def _switch(self) -> tuple[Task, ...]:
        """Takes what was prepared for the active contacts; the tasks suspended by another set."""

    @abstractmethod
    def _assemble(self) -> None:
        """Writes the rows."""

    @abstractmethod
    def _solve(self) -> A:
        """Solves them."""

    @abstractmethod
    def _command(self, answer: A, state: RobotState) -> Command:
        """What the answer amounts to, checked, or what is safe instead."""

    @abstractmethod
    def _safe(self, status: CommandStatus, state: object) -> Command:
        """What is safe where there is no answer, or no state."""

    @abstractmethod
    def _task_residuals(self) -> dict[str, float]:
        """Norm of what each task could not meet at the last tick, by its name."""

    @abstractmethod
    def _explain(self) -> str:
        """What could not be met at the last tick, in words."""
