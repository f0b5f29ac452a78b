"""`ShippedTask`: a task whose formulas are compiled, so that many cost one call.

`VectorTarget` and `PoseTarget`: what such a task is told, in the array that its formulas read.
"""

import math
from collections.abc import Sequence
from typing import Generic, TypeVar, cast

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise.dynamics import Dynamics
from poise.errors import TargetError
from poise.robots import Robot
from poise.stack._axes import Pose, checked_rates, checked_rotation, checked_target, split_pose
from poise.stack._owner import Owner
from poise.stack._tables import (
    GAINS,
    TARGET_ACCELERATION,
    TARGET_ROTATION,
    TARGET_SIZE,
    TARGET_VELOCITY,
    Rows,
)
from poise.stack._task import Task


class VectorTarget:
    """A moving target for a vector, or "where you are" until one is set.

    Args:
        dim: length of the vector.
        what: what messages call it.

    Attributes:
        memory: position, velocity and acceleration, one after another; NaN for no position.
    """

    def __init__(self, dim: int, what: str) -> None:
        self._dim, self._held = dim, False
        self._whats = _names_of(what)
        self.memory: Float64[np.ndarray, " k"] = np.zeros(3 * dim)
        self.memory[:dim] = np.nan

    def set(
        self,
        position: Numbers,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Set the target; rates that are not given are zero."""
        memory, dim, (what, what_velocity, what_acceleration) = self.memory, self._dim, self._whats
        position = checked_target(position, dim, what)
        if velocity is not None:
            velocity = checked_target(velocity, dim, what_velocity)
        if acceleration is not None:
            acceleration = checked_target(acceleration, dim, what_acceleration)
        memory[:dim] = position
        memory[dim : 2 * dim] = 0.0 if velocity is None else velocity
        memory[2 * dim :] = 0.0 if acceleration is None else acceleration
        self._held = False

    def overwrite(self) -> Float64[np.ndarray, "3 dim"]:
        """Return the memory by rows, for `ShippedTask.overwrite_target`."""
        self._held = False
        return self.memory.reshape(3, self._dim)

    @property
    def position(self) -> Float64[np.ndarray, " m"] | None:
        """A copy of the position; None until one is set or held."""
        return None if math.isnan(self.memory[0]) else self.memory[: self._dim].copy()

    def hold(self, actual: Float64[np.ndarray, " m"]) -> None:
        """Make the actual value the target where none was set."""
        if math.isnan(self.memory[0]):
            self.memory[: self._dim] = actual
            self._held = True

    def release_hold(self) -> None:
        """Forget a target that was taken from the robot."""
        if self._held:
            self.memory[: self._dim], self._held = np.nan, False


class PoseTarget:
    """A moving target for a pose, each half "where you are" until it is set.

    Args:
        what: what messages call it.
        components: those of the frame's motion that follow it, linear from 0, angular from 3;
            rates of the others need not be given.

    Attributes:
        memory: position, rotation row by row, velocity and acceleration, linear before angular;
            NaN for what is not set.
    """

    def __init__(self, what: str, components: Sequence[int] = range(6)) -> None:
        turns, moves = max(components) >= 3, min(components) < 3
        self._alone = None if turns and moves else slice(3, 6) if turns else slice(0, 3)
        self._whats, self._what_rotation = _names_of(what), f"target rotation of {what}"
        self._held: list[slice] = []
        self.memory: Float64[np.ndarray, "24"] = np.zeros(TARGET_SIZE)
        self.memory[:TARGET_VELOCITY] = np.nan

    def set(
        self,
        position: Pose | None,
        rotation: Numbers | None,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Set what is given; rates belong to what is given beside them."""
        what, what_velocity, what_acceleration = self._whats
        pose = None if position is None else split_pose(position, what)
        if pose is not None:
            if rotation is not None:
                raise TargetError(
                    f"{what} is a pose with a rotation beside it", got=rotation, wanted="one alone"
                )
            position, rotation = pose
        if velocity is not None:
            velocity = checked_rates(velocity, self._alone, what_velocity)
        if acceleration is not None:
            acceleration = checked_rates(acceleration, self._alone, what_acceleration)
        if rotation is not None:
            rotation = checked_rotation(rotation, self._what_rotation)
        if position is not None:
            self._put(_POSITION, checked_target(cast("Numbers", position), 3, what))
        if rotation is not None:
            self._put(_ROTATION, rotation.ravel())
        first = 0 if position is not None or rotation is None else 3
        end = 6 if rotation is not None or position is None else 3
        for start, rate in ((TARGET_VELOCITY, velocity), (TARGET_ACCELERATION, acceleration)):
            self.memory[start + first : start + end] = 0.0 if rate is None else rate[first:end]

    def overwrite(self) -> Float64[np.ndarray, "8 3"]:
        """Return the memory by rows, for `ShippedTask.overwrite_target`."""
        self._held.clear()
        return self.memory.reshape(8, 3)

    @property
    def position(self) -> Float64[np.ndarray, "3"] | None:
        """A copy of the position [m]; None until one is set or held."""
        return None if math.isnan(self.memory[0]) else self.memory[_POSITION].copy()

    @property
    def rotation(self) -> Float64[np.ndarray, "3 3"] | None:
        """A copy of the rotation; None until one is set or held."""
        rotation = self.memory[_ROTATION]
        return None if math.isnan(rotation[0]) else rotation.reshape(3, 3).copy()

    def hold(
        self,
        position: Float64[np.ndarray, "3"],
        rotation: Float64[np.ndarray, "3 3"] | None,
    ) -> None:
        """Make the actual values the target where none was set; no rotation where it is None."""
        for part, actual in ((_POSITION, position), (_ROTATION, rotation)):
            if actual is not None and math.isnan(self.memory[part.start]):
                self.memory[part] = actual.ravel()
                self._held.append(part)

    def release_hold(self) -> None:
        """Forget what was taken from the robot."""
        for part in self._held:
            self.memory[part] = np.nan
        self._held.clear()

    def _put(self, part: slice, value: Float64[np.ndarray, " m"]) -> None:
        self.memory[part] = value
        if part in self._held:
            self._held.remove(part)


def _names_of(what: str) -> tuple[str, str, str]:
    """Names of a target's position, velocity and acceleration in messages."""
    return f"target of {what}", f"target velocity of {what}", f"target acceleration of {what}"


_POSITION, _ROTATION = slice(0, TARGET_ROTATION), slice(TARGET_ROTATION, TARGET_VELOCITY)


T = TypeVar("T", VectorTarget, PoseTarget)


class ShippedTask(Owner, Task, Generic[T]):
    """A task whose formulas are compiled.

    A subclass says in its attributes which, and keeps what it is told in its target. One that has
    an `_evaluate` of its own is evaluated in Python, like any task; what it calls by `super()` is
    compiled.
    """

    _target: T

    def bind(self, robot: Robot) -> None:
        """Resolve names and puts all that the formulas read into one array."""
        if self.is_bound_to(robot):
            return
        super().bind(robot)
        self.parameters = np.concatenate((self._gain_rows.ravel(), self._target.memory))
        self.share_memory()

    def share_memory(self) -> None:
        """Make gains and target views of the array that the formulas read."""
        if self._robot is not None:
            size = GAINS * self.dim
            self._take_gains(self.parameters[:size].reshape(GAINS, self.dim))
            self._target.memory = self.parameters[size:]

    def overwrite_target(self) -> Float64[np.ndarray, "rows size"]:
        """Return the target's numbers, for a leader to write what it computed: nothing is checked.

        Returns:
            Position, velocity and acceleration, a row each; of a pose its position, three rows of
            its rotation, then linear and angular velocity and acceleration.
        """
        return self._target.overwrite()

    def reset(self) -> None:
        """Forget a target that was taken from the robot."""
        self._target.release_hold()

    def view(self, rows: Rows, own: slice, nv: int) -> None:
        """Take views of its rows as its attributes."""
        super().view(rows, own, nv)
        self.error, self.error_rate = rows.error[own], rows.error_rate[own]
        self._fade = rows.fade[own]

    @property
    def is_compiled(self) -> bool:
        """True where no method of a subclass replaces the compiled formulas."""
        kind = type(self)
        return kind._evaluate is ShippedTask._evaluate and kind.evaluate is Task.evaluate

    def _evaluate(self, dynamics: Dynamics) -> Float64[np.ndarray, " m"]:
        return self.evaluate_alone(dynamics).feedforward
