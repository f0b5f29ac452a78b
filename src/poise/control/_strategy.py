"""`Strategy`: torques or velocities of the joints from a state and a stack.

`Answer`: the result for one state.
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
the level of balance and self-collision limit between them is optional and has no number."""

PHYSICS_TOLERANCE = 1e-6
"""Relative residual of dynamics and torque limits above which torques cannot be trusted."""

UNSOFTENED = 1e-2
"""Change of a level by its softening term below which the level is solved without it
[m/s^2, rad/s^2]: a thousandth of gravity, the effect of a tilt of 1 mrad on an accelerometer."""


class Answer(NamedTuple):
    """Result of a strategy for one state; the controller checks and clips the joints' numbers."""

    status: SolveStatus
    joints: Float64[np.ndarray, " nj"]  # torques [N m] or velocities [rad/s]
    residuals: tuple[float, ...]  # of the levels, |W (A x - b)| / max(1, |W b|)
    acceleration: Float64[np.ndarray, " nv"] | None = None  # None where it is not decided
    wrenches: Mapping[str, Float64[np.ndarray, " m"]] = {}  # on the robot, by contact [N, N m]
    held_back: bool = False  # by the balance limit


class Program(Protocol):
    """Solver of a stack for one set of active contacts; its memory lasts from tick to tick."""

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks replaced by a contact; they have no rows."""
        ...

    @property
    def softened(self) -> dict[int, float]:
        """Weight of each softened level's term at the last solve; levels count from zero."""
        ...

    @property
    def size(self) -> tuple[int, int]:
        """Variables and rows, finite bounds on single variables among them, of the last solve."""
        ...

    def assemble(self, dynamics: Dynamics) -> None:
        """Write one state's rows, in place; `dynamics` is up to date."""
        ...

    def solve(self) -> Answer:
        """Solve the assembled problem; nothing raises on numbers."""
        ...

    def reset(self) -> None:
        """Forget the last solution, so that the next solve starts cold."""
        ...

    def task_residuals(self) -> dict[str, float]:
        """Return the norm of each task's residual at the last solve, by its name [unit/s^2]."""
        ...

    def explain(self) -> str:
        """Describe conflicts of rows at the last solve."""
        ...


@runtime_checkable
class Strategy(Program, Protocol):
    """Solver of a stack for torques or velocities of the joints.

    The controller checks states and falls back. An optional class attribute `kept` names attributes
    that a copy of the controller keeps.

    Attributes:
        robot: the robot.
        commands: kind of the command.
    """

    robot: Robot
    commands: Literal["torque", "velocity"]

    @property
    def stack(self) -> Stack:
        """Contacts, limits and tasks, bound to the robot."""
        ...

    def prepare(self, contacts: tuple[Contact, ...]) -> bool:
        """Use the memory of a set of active contacts; return True where that is another."""
        ...

    def rehearse(self, dynamics: Dynamics) -> None:
        """Run a tick under every prepared set of contacts, and forget it: first ticks are slow."""
        ...


class ContactProgram(Program, Protocol):
    """A `Program` among those of other contacts."""

    def follow(self, last: Any) -> None:
        """Begin the next solve where the program of other contacts ended."""
        ...


P = TypeVar("P", bound=ContactProgram)


class Programs(Generic[P]):
    """A `Strategy` of torques that has one program, made once, for each set of active contacts."""

    commands: Literal["torque", "velocity"] = "torque"

    def __init__(self, robot: Robot, stack: Stack, make: Callable[[tuple[Contact, ...]], P]):
        self.robot, self.stack = robot, stack
        self.prepared = ContactSets(stack, make)
        self.current = self.prepared.of(stack.active_contacts)
        self._solved = False

    @property
    def suspended(self) -> tuple[Task, ...]:
        return self.current.suspended

    @property
    def softened(self) -> dict[int, float]:
        return self.current.softened if self._solved else {}

    @property
    def size(self) -> tuple[int, int]:
        return self.current.size if self._solved else (0, 0)

    def prepare(self, contacts: tuple[Contact, ...]) -> bool:
        last, self.current = self.current, self.prepared.of(contacts)
        if self.current is last:
            return False
        if self._solved:
            self.current.follow(last)
        return True

    def rehearse(self, dynamics: Dynamics) -> None:
        for program in self.prepared:
            program.assemble(dynamics)
            program.solve()
            # Rows that two programs share are found once.
            for other in self.prepared:
                program.follow(other)
        self.reset()

    def assemble(self, dynamics: Dynamics) -> None:
        self.current.assemble(dynamics)

    def solve(self) -> Answer:
        """Solve the assembled problem; an answer that breaks the dynamics has failed."""
        answer = self.current.solve()
        self._solved = True
        if answer.status in USABLE and not answer.residuals[0] <= PHYSICS_TOLERANCE:
            return answer._replace(status=SolveStatus.FAILED)
        return answer

    def reset(self) -> None:
        self._solved = False
        for program in self.prepared:
            program.reset()

    def task_residuals(self) -> dict[str, float]:
        return self.current.task_residuals() if self._solved else {}

    def explain(self) -> str:
        return self.current.explain() if self._solved else "nothing solved yet"


def softening_notes(softened: dict[int, float]) -> list[str]:
    """Return a line for each softened level."""
    return [
        f"  level {PHYSICS_LEVELS + level + 1} is softened towards the posture, with {weight:.2g} "
        "of the weight of its rows"
        for level, weight in softened.items()
    ]


USABLE = (SolveStatus.OPTIMAL, SolveStatus.INACCURATE)
"""Not a point cut short by the time cap, which may meet the dynamics without the contacts."""


def bound_stack(robot: Robot, stack: Stack | None) -> Stack:
    """Bind the stack of a controller to its robot."""
    checked_kind(robot, Robot, "the controller's robot")
    stack = default_stack(robot) if stack is None else stack
    checked_kind(stack, Stack, "the controller's stack").bind(robot)
    return stack


def solver_maker(
    strategy: str, backend: str | None, time_limit: float | None
) -> Callable[[], Solver]:
    """Make a factory of solvers, each with a workspace of its own."""
    checked_time_limit(time_limit)
    return lambda: make_solver(strategy, backend, time_limit=time_limit)
