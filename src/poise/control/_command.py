"""`Command`: what a controller answers each tick, with the status that says how far to trust it.

`Commands`: what it answers to many states at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import overload

import numpy as np
from jaxtyping import Bool, Float64


class CommandStatus(Enum):
    """How a command came about."""

    OK = "ok"
    """Every level was solved; what could not be met stands in the residuals."""
    SOLVER_FAILED = "solver_failed"
    """The solver returned nothing usable, or a task of a user's own could not be evaluated: the
    last good command, decayed towards damping."""
    TIME_LIMIT = "time_limit"
    """The solve reached its time cap before its last level: decayed towards damping."""
    BAD_STATE = "bad_state"
    """The state held NaN or infinity, or had the wrong shape: decayed towards damping. The
    controller's `status().reason` says which entry."""
    FALLEN = "fallen"
    """The robot lies: decayed towards damping, until it stands again."""

    @property
    def ok(self) -> bool:
        """Whether the command is what the tasks asked for, not a fallback."""
        return self is CommandStatus.OK


@dataclass(frozen=True, slots=True)
class Command:
    """What the joints should do until the next tick. Always finite and within limits.

    Attributes:
        status: how the command came about.
        torque: joint torques [N m], None for a velocity command.
        velocity: joint velocities [rad/s], None for a torque command.
        acceleration: generalized accelerations that the command was computed for [m/s^2, rad/s^2].
        wrenches: wrench [force; moment] on the robot expected at each contact, in the contact's
            frame at its centre [N, N m].
        residuals: norm of what each level could not meet, relative to the level's scale; empty
            when nothing was solved. The first two are physics: a second one above 1e-6 says that
            contacts and joint limits cannot all be held in this state, as in a fall, whatever the
            status.
        held_back: whether the stack's balance limit holds the motion back: tasks ask for more than
            the feet can catch, or the legs reach, and are followed as far as that.
    """

    status: CommandStatus
    torque: Float64[np.ndarray, " nj"] | None = None
    velocity: Float64[np.ndarray, " nj"] | None = None
    acceleration: Float64[np.ndarray, " nv"] | None = None
    wrenches: Mapping[str, Float64[np.ndarray, " m"]] = field(default_factory=dict)
    residuals: tuple[float, ...] = ()
    held_back: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Commands(Sequence[Command]):
    """Commands for many states, in their order; each as `Command` by its index.

    Attributes:
        statuses: how each came about.
        torque: joint torques, always finite and within limits [N m].
        acceleration: generalized accelerations that they were computed for [m/s^2, rad/s^2]; as the
            two below, NaN where there was no answer.
        wrenches: wrench on the robot expected at each contact, by the contact's name [N, N m].
        residuals: norm of what each level could not meet, relative to the level's scale.
    """

    statuses: tuple[CommandStatus, ...]
    torque: Float64[np.ndarray, "count nj"]
    acceleration: Float64[np.ndarray, "count nv"]
    wrenches: dict[str, Float64[np.ndarray, "count _"]]
    residuals: Float64[np.ndarray, "count levels"]

    @property
    def ok(self) -> Bool[np.ndarray, " count"]:
        """Which of them are what the tasks asked for, not a fallback."""
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
