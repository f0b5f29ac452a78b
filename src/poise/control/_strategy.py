"""`Strategy`: from a state and a stack to what the joints should do.

`Answer`: what a strategy found for one state.
`Programs`: a strategy that has one program for each set of active contacts.
"""

from collections.abc import Callable, Mapping
from typing import Any, Generic, Literal, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_kind, checked_time_limit
from poise.dynamics import Dynamics
from poise.hqp import Solver, SolveStatus, make_solver
from poise.robots import Robot
from poise.stack import Contact, ContactSets, Stack, Task, default_stack

PHYSICS_LEVELS = 2
"""Levels of physics: dynamics with torque limits, contacts with joint limits. The user's follow;
that of the balance limit, which stands between, has no number, since a stack may do without it."""

PHYSICS_TOLERANCE = 1e-6
"""Relative residual of dynamics and torque limits above which torques cannot be trusted."""

UNSOFTENED = 1e-2
"""Acceleration by which a softening term has to be able to change a level to be solved with
[m/s^2, rad/s^2]: a thousandth of gravity, what a tilt of 1 mrad does to an accelerometer."""


class Answer(NamedTuple):
    """What a strategy found for one state.

    Attributes:
        status: how the solve ended; an answer that is not to be trusted has failed.
        joints: joint torques [N m] or velocities [rad/s], whichever the strategy commands; the
            controller checks that they are finite, and clips torques to their limits.
        residuals: norm of what each level could not meet, relative to the level's scale,
            |W (A x - b)| / max(1, |W b|).
        acceleration: generalized acceleration [m/s^2, rad/s^2]; None where it is not decided.
        wrenches: wrench on the robot at each active contact, by the contact's name [N, N m].
        held_back: whether the balance limit holds the motion back.
    """

    status: SolveStatus
    joints: Float64[np.ndarray, " nj"]
    residuals: tuple[float, ...]
    acceleration: Float64[np.ndarray, " nv"] | None = None
    wrenches: Mapping[str, Float64[np.ndarray, " m"]] = {}
    held_back: bool = False


class Program(Protocol):
    """Solves a stack for one set of active contacts; its memory lasts from tick to tick."""

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stands in for; they have no rows."""
        ...

    @property
    def softened(self) -> dict[int, float]:
        """Weight of the softening term of each level that was softened at the last solve.

        Levels of the stack count from zero.
        """
        ...

    @property
    def size(self) -> tuple[int, int]:
        """Variables and rows, finite bounds on single variables among them, of the last solve."""
        ...

    def assemble(self, dynamics: Dynamics) -> None:
        """Writes one state's rows, in place; `dynamics` is up to date."""
        ...

    def solve(self) -> Answer:
        """Solves what was assembled; nothing raises on numbers."""
        ...

    def reset(self) -> None:
        """Forgets the last solution, so that the next solve starts cold."""
        ...

    def task_residuals(self) -> dict[str, float]:
        """Norm of what each task could not meet at the last solve, by its name [unit/s^2]."""
        ...

    def explain(self) -> str:
        """Which rows conflict and with what at the last solve, in words."""
        ...


@runtime_checkable
class Strategy(Program, Protocol):
    """How a controller turns a state and a stack into torques or velocities of the joints.

    It never sees the plant, and need not check states or fall back: the controller does.

    One that has a class attribute `kept` names attributes of its own there that a copy of its
    controller takes over.

    Attributes:
        robot: the robot.
        commands: what the joints are told.
    """

    robot: Robot
    commands: Literal["torque", "velocity"]

    @property
    def stack(self) -> Stack:
        """Contacts, limits and tasks, bound to the robot."""
        ...

    def prepare(self, contacts: tuple[Contact, ...]) -> bool:
        """Takes up what belongs to a set of active contacts."""
        ...

    def rehearse(self, dynamics: Dynamics) -> None:
        """Goes through a tick under every prepared set of contacts, and forgets it.

        A first tick in fresh memory takes several times as long as those that follow.
        """
        ...


class ContactProgram(Program, Protocol):
    """A `Program` among those of other contacts."""

    def follow(self, last: Any) -> None:
        """Begins the next solve where another of its kind ended: that of other contacts."""
        ...


P = TypeVar("P", bound=ContactProgram)


class Programs(Generic[P]):
    """A `Strategy` of torques that has one program, made once, for each set of active contacts.

    Attributes:
        robot: the robot.
        stack: contacts, limits and tasks.
        current: the program of the last tick.
        prepared: all programs.
    """

    commands: Literal["torque", "velocity"] = "torque"

    def __init__(self, robot: Robot, stack: Stack, make: Callable[[tuple[Contact, ...]], P]):
        self.robot, self.stack = robot, stack
        self.prepared = ContactSets(stack, make)
        self.current = self.prepared.of(stack.active_contacts)
        self._solved = False

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stands in for."""
        return self.current.suspended

    @property
    def softened(self) -> dict[int, float]:
        """Weight of the softening term of each level that was softened, counted from zero."""
        return self.current.softened if self._solved else {}

    @property
    def size(self) -> tuple[int, int]:
        """Number of variables and of rows, finite bounds on single variables among them."""
        return self.current.size if self._solved else (0, 0)

    def prepare(self, contacts: tuple[Contact, ...]) -> bool:
        """Takes up the program of a set of active contacts."""
        last, self.current = self.current, self.prepared.of(contacts)
        if self.current is last:
            return False
        if self._solved:
            self.current.follow(last)
        return True

    def rehearse(self, dynamics: Dynamics) -> None:
        """Goes through a tick under every prepared set of contacts, and forgets it."""
        for program in self.prepared:
            program.assemble(dynamics)
            program.solve()
            # Which rows two programs share is found once.
            for other in self.prepared:
                program.follow(other)
        self.reset()

    def assemble(self, dynamics: Dynamics) -> None:
        """Writes one state's rows, in place."""
        self.current.assemble(dynamics)

    def solve(self) -> Answer:
        """Solves what was assembled; an answer that breaks the dynamics has failed."""
        answer = self.current.solve()
        self._solved = True
        if answer.status in USABLE and not answer.residuals[0] <= PHYSICS_TOLERANCE:
            return answer._replace(status=SolveStatus.FAILED)
        return answer

    def reset(self) -> None:
        """Forgets the last solutions."""
        self._solved = False
        for program in self.prepared:
            program.reset()

    def task_residuals(self) -> dict[str, float]:
        """Norm of what each task could not meet at the last solve, by its name [unit/s^2]."""
        return self.current.task_residuals() if self._solved else {}

    def explain(self) -> str:
        """Which rows conflict and with what at the last solve, in words."""
        return self.current.explain() if self._solved else "nothing solved yet"


def softening_notes(softened: dict[int, float]) -> list[str]:
    """Return a line for each softened level."""
    return [
        f"  level {PHYSICS_LEVELS + level + 1} is softened towards the posture, with {weight:.2g} "
        "of the weight of its rows"
        for level, weight in softened.items()
    ]


USABLE = (SolveStatus.OPTIMAL, SolveStatus.INACCURATE)
"""A point cut short by the time cap is not: it may meet the dynamics and know no contact yet."""


def bound_stack(robot: Robot, stack: Stack | None) -> Stack:
    """The stack of a controller with every name resolved on its robot."""
    checked_kind(robot, Robot, "the controller's robot")
    stack = default_stack(robot) if stack is None else stack
    checked_kind(stack, Stack, "the controller's stack").bind(robot)
    return stack


def solver_maker(
    strategy: str, backend: str | None, time_limit: float | None
) -> Callable[[], Solver]:
    """Factory of a controller's solvers, each with a workspace of its own."""
    checked_time_limit(time_limit)
    return lambda: make_solver(strategy, backend, time_limit=time_limit)
