"""Mistakes of wiring, frames, units and clocks, seeded between a link and its reader."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from poise.hardware import Link, MotorState

JOINT = "q", "dq", "tau", "temperature"
Change = Callable[[MotorState], MotorState]


class Mistaken:
    """A link that changes states, has fresh ones at some times only, or other attributes."""

    def __init__(
        self,
        link: Link,
        change: Change = lambda state: state,
        fresh: Callable[[float], bool] = math.isfinite,
        **attributes: Any,
    ) -> None:
        names = "info", "status", "refused", "reason", "clock", "write", "close"
        vars(self).update({name: getattr(link, name) for name in names} | attributes)
        self._link, self._change, self._fresh, self._last = link, change, fresh, link.read()

    def read(self) -> MotorState:
        """Return the newest state, mistaken."""
        state = self._link.read()
        self._last = state if self._fresh(state.time) else self._last
        return self._change(self._last)


def of_joints(act: Callable[[np.ndarray], Any], names: tuple[str, ...] = JOINT[:3]) -> Change:
    """Return a change of arrays of joints in place."""

    def change(state: MotorState) -> MotorState:
        copies = {name: getattr(state, name).copy() for name in names}
        for copy in copies.values():
            act(copy)
        return replace(state, **copies)

    return change


def swapped(i: int, j: int, names: tuple[str, ...] = JOINT) -> Change:
    """Interchange two joints."""
    return of_joints(lambda a: a.__setitem__([i, j], a[[j, i]]), names)


def scaled(
    i: int, factor: float, offset: float = 0.0, names: tuple[str, ...] = JOINT[:3]
) -> Change:
    """Scale a joint: -1 flips its sign, 0 is a motor that is missing or stands at the offset."""
    return of_joints(lambda a: a.__setitem__(i, factor * a[i] + offset), names)


def turned(rotation: np.ndarray, *names: str) -> Change:
    """Turn or mirror vectors of the inertial unit; with "quaternion" all of it is mounted so."""

    def change(state: MotorState) -> MotorState:
        values = {n: rotation @ getattr(state, n) for n in names if n != "quaternion"}
        if "quaternion" in names:
            pose = pin.Quaternion(state.quaternion) * pin.Quaternion(rotation.T)
            values["quaternion"] = pose.coeffs()
        return replace(state, **values)

    return change
