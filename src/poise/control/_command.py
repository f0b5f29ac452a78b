"""`Command`: the answer of a controller for one tick, with its status.

`Commands`: the answers for many states.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import overload

import numpy as np
from jaxtyping import Bool, Float64


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
    """The robot lies: decayed towards damping, until it stands again."""

    @property
    def ok(self) -> bool:
        """True for a solved command, False for a fallback."""
        return self is CommandStatus.OK


@dataclass(frozen=True, slots=True)
class Command:
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
    wrenches: Mapping[str, Float64[np.ndarray, " m"]] = field(default_factory=dict)
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
