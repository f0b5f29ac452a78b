"""`LimbFeedback`: how firmly led limbs follow their model, by torques or by servos."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._checks import all_finite
from poise.stack import JointTask

_STIFFEN = 0.5
"""How long limbs take to become stiff when they are led, and soft again at rest [s]."""

_BIAS_MAX = 30.0
"""Largest acceleration that is learned for what a hand carries [rad/s^2]."""


class Firmness(NamedTuple):
    """Stiffness at rest and in motion [1/s^2]; rate at which lag becomes a bias [1/s^3]."""

    rest: float
    led: float
    learning: float


ARMS_BY_TORQUES = Firmness(25.0, 150.0, 150.0)
"""At rest as stiff as the posture; what a hand carries, and nobody knows of, is learned."""

NECK_BY_TORQUES = Firmness(100.0, 100.0, 0.0)
"""A head carries nothing."""

BY_SERVOS = Firmness(0.0, 16.0, 0.0)
"""Servos follow by themselves and carry what there is, so nothing is learned, and at rest nothing
is asked for at all. What led joints sag by, or missed in ticks that failed, is taken back at 2 /s:
the rate is half the root of the stiffness."""


class LimbFeedback:
    """Stiffens limbs in motion, and learns what they carry as a `bias`."""

    def __init__(self, task: JointTask | None, firmness: Firmness, dt: float) -> None:
        self._task, self._firmness, self._dt = task, firmness, dt
        self.reset()

    def reset(self) -> None:
        """The limbs are at rest, and carry nothing."""
        self._stiff = 0.0
        self.bias: Float64[np.ndarray, " n"] = np.zeros(0 if self._task is None else self._task.dim)
        if self._task is not None:
            self._task.set_gains(self._firmness.rest)

    def stiffen(self, *, led: bool) -> None:
        """Take a tick in which the joints follow an operator, or rest."""
        change = self._dt / _STIFFEN if led else -self._dt / _STIFFEN
        before, self._stiff = self._stiff, min(max(self._stiff + change, 0.0), 1.0)
        if self._task is not None and self._stiff != before:
            rest, most, _ = self._firmness
            self._task.set_gains(rest + self._stiff * (most - rest))
            if not self.learns:
                self.bias = np.zeros(self._task.dim)

    @property
    def rests(self) -> bool:
        """True while the joints are as soft as at rest, and nothing is learned."""
        return self._stiff == 0.0

    @property
    def learns(self) -> bool:
        """Whether joints are led, or were lately, and lag says something: at rest they forget."""
        return self._stiff > 0.0 and self._firmness.learning > 0.0

    def learn(self, lag: Float64[np.ndarray, " n"]) -> None:
        """Take a tick in which it `learns` from what joints are behind their model [rad]."""
        if not all_finite(lag):
            return
        bias = self.bias + self._dt * self._firmness.learning * lag
        self.bias = np.clip(self._stiff * bias, -_BIAS_MAX, _BIAS_MAX)
