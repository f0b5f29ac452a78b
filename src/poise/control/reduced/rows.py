"""Where the rows of tasks lie in the levels of a problem."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64, Int64

from poise.control.reduced.assignment import Assignment
from poise.hqp import LevelView

TaskRows = tuple[
    Assignment,
    Int64[np.ndarray, " _"],
    Float64[np.ndarray, "_ n"],
    Float64[np.ndarray, " _"],
    Float64[np.ndarray, " _"],
]
"""A task, which of its rows, and the views of them: coefficients, lower and upper bounds."""


def locate_rows(
    views: Sequence[LevelView],
    levels: Sequence[Sequence[tuple[Assignment, Int64[np.ndarray, " _"]]]],
) -> list[TaskRows]:
    """Lays rows of tasks out in a problem's levels, one after the other, and sets their weights.

    Args:
        views: the levels of the problem that hold tasks.
        levels: for each, its tasks and which of their rows stand there; none is fine.

    Returns:
        Every task that has rows there.
    """
    located: list[TaskRows] = []
    for view, level in zip(views, levels, strict=True):
        first = 0
        for assignment, rows in level:
            if len(rows):
                place = slice(first, first + len(rows))
                view.weights[place] = assignment.task.weight[rows]
                located.append(
                    (assignment, rows, view.A[place], view.lower[place], view.upper[place])
                )
                first = place.stop
    return located
