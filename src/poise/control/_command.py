"""`Command`: the answer of a controller for one tick. `Commands`: the answers for many states.

`ControllerStatus`: level, error and residual of each task, with units.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, overload

import numpy as np
from jaxtyping import Bool, Float64

from poise._show import html_table
from poise.control._strategy import PHYSICS_LEVELS
from poise.stack import Stack, Task


class CommandStatus(Enum):
    """Origin of a command: solved or fallback."""

    OK = "ok"
    """Every level was solved, with the residuals of the command."""
    SOLVER_FAILED = "solver_failed"
    """The solver returned nothing usable, or a user's task could not be evaluated: the last good
    command, decayed towards damping."""
    TIME_LIMIT = "time_limit"
    """The solve reached its time cap before its last level: decayed towards damping."""
    BAD_STATE = "bad_state"
    """The state held NaN or infinity, or had the wrong shape: decayed towards damping. The
    controller's `status().reason` names the entry."""
    FALLEN = "fallen"
    """The robot has fallen: decayed towards damping, until it stands again."""

    @property
    def ok(self) -> bool:
        """True for a solved command, False for a fallback."""
        return self is CommandStatus.OK


class Command(NamedTuple):
    """Torques or velocities of the joints until the next tick, always finite and within limits.

    Attributes:
        status: origin of the command.
        torque: joint torques [N m], None for a velocity command.
        velocity: joint velocities [rad/s], None for a torque command.
        acceleration: generalized accelerations of the command [m/s^2, rad/s^2].
        wrenches: wrench [force; moment] on the robot expected at each contact, in the contact's
            frame at its centre [N, N m].
        residuals: norm of each level's residual, relative to the level's scale; empty when nothing
            was solved. The first two are physics: where the second is above 1e-6, contacts and
            joint limits cannot all be held in this state, as in a fall, whatever the status.
        held_back: True where the stack's balance limit holds the motion back: tasks are followed
            as far as the feet can catch and the legs reach.
    """

    status: CommandStatus
    torque: Float64[np.ndarray, " nj"] | None = None
    velocity: Float64[np.ndarray, " nj"] | None = None
    acceleration: Float64[np.ndarray, " nv"] | None = None
    wrenches: Mapping[str, Float64[np.ndarray, " m"]] = {}
    residuals: tuple[float, ...] = ()
    held_back: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Commands(Sequence[Command]):
    """Commands for many states, in their order; each as `Command` by its index.

    Attributes:
        statuses: origin of each.
        torque: joint torques, always finite and within limits [N m].
        acceleration: generalized accelerations of the commands [m/s^2, rad/s^2]; as the two below,
            NaN where there was no answer.
        wrenches: wrench on the robot expected at each contact, by the contact's name [N, N m].
        residuals: norm of each level's residual, relative to the level's scale.
    """

    statuses: tuple[CommandStatus, ...]
    torque: Float64[np.ndarray, "count nj"]
    acceleration: Float64[np.ndarray, "count nv"]
    wrenches: dict[str, Float64[np.ndarray, "count _"]]
    residuals: Float64[np.ndarray, "count levels"]

    @property
    def ok(self) -> Bool[np.ndarray, " count"]:
        """True for solved commands, False for fallbacks."""
        return np.array([status.ok for status in self.statuses], dtype=np.bool_)

    def __len__(self) -> int:
        return len(self.statuses)

    @overload
    def __getitem__(self, index: int) -> Command: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Command]: ...
    def __getitem__(self, index: int | slice) -> Command | Sequence[Command]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        status, torque = self.statuses[index], self.torque[index]
        if not status.ok:
            return Command(status=status, torque=torque)
        return Command(
            status=status,
            torque=torque,
            acceleration=self.acceleration[index],
            wrenches={name: wrench[index] for name, wrench in self.wrenches.items()},
            residuals=tuple(self.residuals[index].tolist()),
        )


@dataclass(frozen=True, kw_only=True)
class TaskStatus:
    """Error and residual of one task.

    Attributes:
        name: the task's name.
        level: its level in the hierarchy; 1 and 2 are the physics, the user's begin at 3.
        error: norm of target minus actual [unit].
        unit: unit of `error`.
        residual: norm of the acceleration that was not met [unit/s^2]; of the velocity, for a
            controller that commands velocities [unit/s]; NaN for the command of a fallback.
        suspended: True where a contact holds the task's frame, so that the task does not act.
    """

    name: str
    level: int
    error: float
    unit: str
    residual: float
    suspended: bool


@dataclass(frozen=True, kw_only=True)
class ControllerStatus:
    """Outcome of the last tick; printing it gives a table.

    Attributes:
        command: status of the last command.
        reason: fault of the last state, of a user's task, or measure of a fall; "" for other
            commands. `explanation` describes failures of the solver.
        held_back: True where the balance limit holds the motion back; the tasks' residuals are
            then what each misses, and `explanation` names the rows.
        tasks: each task, most important first.
        explanation: conflicts of rows.
        softened: weight of the softening term of each level that was softened, by its number,
            against the weight of the level's own rows.
    """

    command: CommandStatus
    reason: str
    held_back: bool
    tasks: tuple[TaskStatus, ...]
    explanation: str
    softened: Mapping[int, float]

    def __str__(self) -> str:
        width = max([len(t.name) for t in self.tasks], default=4)
        lines = [f"status: {self.command.value}" + (f" ({self.reason})" if self.reason else "")]
        lines[0] += ", held back by the balance limit" if self.held_back else ""
        for level, weight in self.softened.items():
            lines[0] += f", level {level} softened by {weight:.2g}"
        lines.append(f"{'level':>5}  {'task':<{width}}  {'error':>22}  residual")
        for t in self.tasks:
            error = "held by a contact" if t.suspended else f"{t.error:.3g} {t.unit}"
            lines.append(f"{t.level:>5}  {t.name:<{width}}  {error:>22}  {t.residual:.2e}")
        return "\n".join([*lines, self.explanation])

    def _repr_html_(self) -> str:
        rows = [
            (
                t.level,
                t.name,
                "held by a contact" if t.suspended else f"{t.error:.3g} {t.unit}",
                f"{t.residual:.2e}",
            )
            for t in self.tasks
        ]
        title = str(self).splitlines()[0]
        return html_table(title, ("level", "task", "error", "residual"), rows)


def task_statuses(
    stack: Stack, residuals: dict[str, float] | None, suspended: Collection[Task]
) -> tuple[TaskStatus, ...]:
    """Return one `TaskStatus` a task of the stack."""
    return tuple(
        TaskStatus(
            name=task.name,
            level=PHYSICS_LEVELS + level + 1,
            error=float(np.linalg.norm(task.error)),
            unit=task.unit,
            residual=np.nan if residuals is None else residuals.get(task.name, 0.0),
            suspended=task in suspended,
        )
        for level, task in stack.tasks()
    )
