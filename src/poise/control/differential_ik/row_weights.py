"""`RowWeights`: W_A, what each row counts in its level; may change every tick."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float64

from poise.checks import Numbers
from poise.control.stack import Stack
from poise.errors import ConfigurationError
from poise.tasks import Task
from poise.tasks.checks import checked_gain

ROW_WEIGHT = 1e4
"""W_A of a row whose task has weight one.

The SR-inverse weighs rows against the joint velocities themselves: a row that moves a radian a unit
then misses a ten-thousandth of what it is asked for."""


class RowWeights:
    """Diagonal of W_A in (20) of Zhang and Kikuuwe, by task: `weights[task] = 100.0`.

    A task starts at `ROW_WEIGHT` times its weight squared, because a level's slack is measured as
    |W w|. Weights count within a level, and in the closed form against the joint velocities; the
    exact levels of the closed form have none.

    Args:
        stack: whose tasks have rows; bound to the robot.
    """

    def __init__(self, stack: Stack) -> None:
        self._weights = {
            task.name: ROW_WEIGHT * task.weight * task.weight for _, task in stack.tasks()
        }

    def __getitem__(self, task: Task | str) -> Float64[np.ndarray, " m"]:
        """Weights of a task's rows, a copy.

        Raises:
            ConfigurationError: no such task.
        """
        return self._weights[self._name(task)].copy()

    def __setitem__(self, task: Task | str, weight: Numbers) -> None:
        """Sets the weights of a task's rows, one number or one a row.

        Raises:
            ConfigurationError: no such task, a wrong length, or weights that are not positive.
        """
        name = self._name(task)
        what = f"row weight of task {name!r}"
        found = checked_gain(weight, len(self._weights[name]), what)
        if found.min() <= 0.0:
            raise ConfigurationError(f"{what} must be positive", got=weight, wanted="> 0")
        # In place: resolvers hold on to the array.
        self._weights[name][:] = found

    def __iter__(self) -> Iterator[str]:
        """Names of the tasks, most important first."""
        return iter(self._weights)

    def __len__(self) -> int:
        """Number of tasks."""
        return len(self._weights)

    def live(self, task: Task) -> Float64[np.ndarray, " m"]:
        """The array that later settings change."""
        return self._weights[task.name]

    def _name(self, task: Task | str) -> str:
        name = task.name if isinstance(task, Task) else task
        if name not in self._weights:
            raise ConfigurationError(
                "unknown task of the stack", got=name, choices=list(self._weights)
            )
        return name
