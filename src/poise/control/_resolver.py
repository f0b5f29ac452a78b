"""`Resolver`: from the rows of one set of contacts to accelerations, torques and wrenches."""

from collections.abc import Mapping
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics
from poise.hqp import SolveStatus
from poise.stack import Task

PHYSICS_LEVELS = 2
"""Levels that stand above the user's: dynamics with torque limits, contacts with joint limits."""


class Answer(NamedTuple):
    """What a resolver found for one state.

    Attributes:
        status: how the solve ended.
        acceleration: generalized acceleration [m/s^2, rad/s^2].
        torque: joint torques [N m]; finite and within limits only as far as the solution is.
        wrenches: wrench on the robot at each active contact, by the contact's name [N, N m].
        residuals: norm of what each level could not meet, relative to the level's scale.
    """

    status: SolveStatus
    acceleration: Float64[np.ndarray, " nv"]
    torque: Float64[np.ndarray, " nj"]
    wrenches: Mapping[str, Float64[np.ndarray, " m"]]
    residuals: tuple[float, ...]


@runtime_checkable
class Resolver(Protocol):
    """Resolves a stack for one set of active contacts; its memory lasts from tick to tick."""

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stands in for; they have no rows."""
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
        """Norm of what each task could not meet at the last solve [unit/s^2], by its name."""
        ...

    def explain(self) -> str:
        """Which rows conflict and with what at the last solve, in words."""
        ...
