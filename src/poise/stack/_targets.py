"""Targets of tasks, in the arrays that compiled formulas read."""

import math
from collections.abc import Sequence
from typing import cast

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise.errors import TargetError
from poise.stack._axes import Pose, checked_rates, checked_rotation, checked_target, split_pose
from poise.stack._tables import (
    TARGET_ACCELERATION,
    TARGET_ROTATION,
    TARGET_SIZE,
    TARGET_VELOCITY,
)


class Target:
    """A moving target, each part of it "where you are" until it is set.

    Args:
        what: what messages call it.
        memory: its numbers, NaN for what is not set.
        width: numbers of a row of `overwrite`.
        parts: places of what can be held.

    Attributes:
        memory: the same array, or one that formulas read.
    """

    def __init__(
        self, what: str, memory: Float64[np.ndarray, " k"], width: int, *parts: slice
    ) -> None:
        self._whats = (
            f"target of {what}",
            f"target velocity of {what}",
            f"target acceleration of {what}",
        )
        self.memory, self._width, self._parts = memory, width, parts
        for part in parts:
            memory[part] = np.nan
        self._held: list[slice] = []

    def overwrite(self) -> Float64[np.ndarray, "rows width"]:
        """Return the memory by rows, for `ShippedTask.overwrite_target`."""
        self._held.clear()
        return self.memory.reshape(-1, self._width)

    @property
    def position(self) -> Float64[np.ndarray, " m"] | None:
        """A copy of the position; None until one is set or held."""
        position = self.memory[self._parts[0]]
        return None if math.isnan(position[0]) else position.copy()

    def hold(self, *actual: Float64[np.ndarray, "..."] | None) -> None:
        """Make the actual values the target where none was set; nothing where one is None."""
        for part, value in zip(self._parts, actual, strict=True):
            if value is not None and math.isnan(self.memory[part.start]):
                self.memory[part] = value.ravel()
                self._held.append(part)

    def release_hold(self) -> None:
        """Discard the values taken from the robot."""
        for part in self._held:
            self.memory[part] = np.nan
        self._held.clear()

    def _put(self, part: slice, value: Float64[np.ndarray, " m"]) -> None:
        self.memory[part] = value
        if part in self._held:
            self._held.remove(part)


class VectorTarget(Target):
    """A target for a vector: position, velocity and acceleration, one after another.

    Args:
        dim: length of the vector.
        what: what messages call it.
    """

    def __init__(self, dim: int, what: str) -> None:
        super().__init__(what, np.zeros(3 * dim), dim, slice(0, dim))

    def set(self, position: Numbers, *rates: Numbers | None) -> None:
        """Set position, velocity and acceleration; rates that are not given are zero."""
        what, *whats = self._whats
        dim, place = self._width, checked_target(position, self._width, what)
        found = [
            None if rate is None else checked_target(rate, dim, its)
            for rate, its in zip(rates, whats, strict=False)
        ]
        self._put(self._parts[0], place)
        self.memory[dim:] = 0.0
        for i, rate in enumerate(found, 1):
            if rate is not None:
                self.memory[i * dim : (i + 1) * dim] = rate


class PoseTarget(Target):
    """A target for a pose.

    Memory: position, rotation row by row, velocity and acceleration, linear before angular.

    Args:
        what: what messages call it.
        components: those of the frame's motion that follow it, linear from 0, angular from 3;
            rates of the others need not be given.
    """

    def __init__(self, what: str, components: Sequence[int] = range(6)) -> None:
        super().__init__(what, np.zeros(TARGET_SIZE), 3, _POSITION, _ROTATION)
        turns, moves = max(components) >= 3, min(components) < 3
        self._alone = None if turns and moves else slice(3, 6) if turns else slice(0, 3)
        self._what_rotation = f"target rotation of {what}"

    def set(
        self,
        position: Pose | None,
        rotation: Numbers | None,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Set what is given; rates belong to what is given beside them."""
        what, *whats = self._whats
        pose = None if position is None else split_pose(position, what)
        if pose is not None:
            if rotation is not None:
                raise TargetError(
                    f"{what} is a pose with a rotation beside it", got=rotation, wanted="one alone"
                )
            position, rotation = pose
        rates = [
            None if rate is None else checked_rates(rate, self._alone, its)
            for rate, its in zip((velocity, acceleration), whats, strict=True)
        ]
        if rotation is not None:
            rotation = checked_rotation(rotation, self._what_rotation)
        if position is not None:
            self._put(_POSITION, checked_target(cast("Numbers", position), 3, what))
        if rotation is not None:
            self._put(_ROTATION, rotation.ravel())
        first = 0 if position is not None or rotation is None else 3
        end = 6 if rotation is not None or position is None else 3
        for start, rate in zip((TARGET_VELOCITY, TARGET_ACCELERATION), rates, strict=True):
            self.memory[start + first : start + end] = 0.0 if rate is None else rate[first:end]

    @property
    def rotation(self) -> Float64[np.ndarray, "3 3"] | None:
        """A copy of the rotation; None until one is set or held."""
        rotation = self.memory[_ROTATION]
        return None if math.isnan(rotation[0]) else rotation.reshape(3, 3).copy()


_POSITION, _ROTATION = slice(0, TARGET_ROTATION), slice(TARGET_ROTATION, TARGET_VELOCITY)
