"""`ControllerStatus`: level, error and residual of each task, with units."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from poise._show import html_table
from poise.control._command import CommandStatus
from poise.control._strategy import PHYSICS_LEVELS
from poise.stack import Stack, Task


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
