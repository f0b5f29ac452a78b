"""`TrunkFeedback`: what holds pelvis or torso off its orientation for long is learned."""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

_LEARNING = 50.0
"""How fast a lasting error becomes an acceleration [1/s^3]: with the trunk's stiffness of 100 /s^2
within some 2 s."""

_MOST = 30.0
"""Largest acceleration that is learned [rad/s^2]. With a centre of mass taken to be 23 mm from
where it is G1's trunk leaned by 0.23 rad, which is 23 rad/s^2 at its stiffness."""

_THROWN = 0.3
"""A trunk so far off has been thrown: no lasting error [rad]."""


class TrunkFeedback:
    """An integral of one frame's orientation error about its own x and y axes.

    A mass that is taken to be where it is not, as a payload that is found by load cells that are
    off, is a moment that the controller's model has and the robot has not: with a spring alone the
    trunk would lean by it. About the vertical nothing lasts, and the legs' swing turns the trunk.

    What has been learned is kept while nothing is learned: where the trunk balances a push, or
    cannot be as it is asked to, its error says nothing of that moment.
    """

    def __init__(self, dt: float) -> None:
        self._step = _LEARNING * dt
        self.reset()

    def reset(self) -> None:
        """Nothing is known."""
        self._roll = self._pitch = 0.0

    def acceleration(
        self, goal: Float64[np.ndarray, "3 3"], here: Float64[np.ndarray, "3 3"], *, learns: bool
    ) -> Float64[np.ndarray, "3"]:
        """One tick."""
        if learns:
            roll, pitch, _ = pin.log3(here.T.dot(goal)).tolist()
            if math.hypot(roll, pitch) < _THROWN:
                self._roll = min(max(self._roll + self._step * roll, -_MOST), _MOST)
                self._pitch = min(max(self._pitch + self._step * pitch, -_MOST), _MOST)
        return here.dot(np.array([self._roll, self._pitch, 0.0]))
