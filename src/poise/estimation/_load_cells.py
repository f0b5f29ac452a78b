"""`LoadCellTare`: zeros of the load cells, from soles in the air."""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise.dynamics import CheckedWrenches, RobotState

_MEMORY = 5.0
"""Over so much time in the air a zero is averaged; it drifts with temperature [s]."""

_FARTHEST = 0.04
"""Part of the weight, in any direction, beyond which something touches the sole after all."""

_REACH = 0.15
"""A moment that is more than `_FARTHEST` of the weight at so long a lever is none of a zero [m]."""


class LoadCellTare:
    """The zeros of load cells, from soles in the air: there a wrench is all error.

    A force that is off along the ground by 1% of the weight looks like an attitude that is off by
    0.6 degrees, and a moment, or a force at the height of the centre of mass, like a centre of mass
    that is elsewhere. Standing, nothing tells them apart; in the air there is nothing but the zero.
    It is the mean of what they say there, which forgets after 5 s in the air.

    Wrenches have to be of the ground alone, without weight and inertia of what is below the cells.
    Until a sole has been in the air its wrenches are taken as they come. What is less than 4% of
    the weight and touches a sole in the air for long, as a wall may, counts as a part of its zero.

    Attributes:
        zeros: of each sole that has been in the air, by name [N, N m].
    """

    def __init__(self, soles: Sequence[str], weight: float, *, longest: float = 0.05) -> None:
        self._soles, self._longest = tuple(soles), longest
        self._force = _FARTHEST * weight
        self._moment = _REACH * self._force
        self.reset()

    def reset(self) -> None:
        """Restart with zeros of zero."""
        self.zeros: dict[str, Float64[np.ndarray, "6"]] = {}
        self._time, self._seen = math.nan, dict.fromkeys(self._soles, 0.0)

    def update(
        self, state: RobotState, airborne: Sequence[int], estimated: Sequence[str] = ()
    ) -> RobotState:
        """Return the state with wrenches less their zeros; learn those of `airborne` soles."""
        dt, self._time = state.time - self._time, state.time
        for sole, clear in zip(self._soles, airborne, strict=True):
            if clear and sole not in estimated and 0.0 < dt <= self._longest:
                self._learn(sole, state.wrench(sole), dt)
        if not self.zeros:
            return state
        contacts = CheckedWrenches(state.contacts)
        for sole, zero in self.zeros.items():
            wrench = contacts.usable.get(sole)
            if wrench is not None and sole not in estimated:
                contacts[sole] = contacts.usable[sole] = wrench - zero
        return RobotState(state.q, state.v, contacts, state.time, state.readings, state.payload)

    def _learn(self, sole: str, wrench: Float64[np.ndarray, "6"] | None, dt: float) -> None:
        """Average the wrench of a sole in the air, unless it is too large for a zero."""
        if wrench is None:
            return
        f_x, f_y, f_z, m_x, m_y, m_z = wrench.tolist()
        if math.hypot(f_x, f_y, f_z) > self._force or math.hypot(m_x, m_y, m_z) > self._moment:
            return
        before = self.zeros.get(sole)
        if before is None:
            self.zeros[sole] = wrench.copy()
            self._seen[sole] = dt
            return
        self._seen[sole] = seen = min(self._seen[sole] + dt, _MEMORY)
        before += dt / seen * (wrench - before)
