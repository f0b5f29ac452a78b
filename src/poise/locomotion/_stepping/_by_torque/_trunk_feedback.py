"""`TrunkFeedback`: what holds pelvis or torso off its orientation for long is learned."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled

_LEARNING = 50.0
"""How fast a lasting error becomes an acceleration [1/s^3]: with the trunk's stiffness of 100 /s^2
within some 2 s."""

_MOST = 30.0
"""Largest acceleration that is learned: at its stiffness, a lean of 0.3 rad [rad/s^2]."""

_THROWN = 0.3
"""A trunk so far off has been thrown: no lasting error [rad]."""


class TrunkFeedback:
    """Integrate one frame's orientation error about its own x and y: a moment the model lacks."""

    def __init__(self, dt: float) -> None:
        self._step = _LEARNING * dt
        self._learned: Float64[np.ndarray, "2"] = np.zeros(2)
        # What is compiled is compiled now, not in the first tick.
        self.apply(np.zeros(24), np.eye(3), learns=False)

    def reset(self) -> None:
        """Nothing is known."""
        self._learned[:] = 0.0

    def apply(
        self, target: Float64[np.ndarray, "24"], here: Float64[np.ndarray, "3 3"], *, learns: bool
    ) -> None:
        """Take a tick, and write the acceleration into a pose target beside its rotation."""
        _apply(target, here, self._step if learns else 0.0, self._learned)


@compiled
def _apply(
    target: Float64[np.ndarray, "24"],
    here: Float64[np.ndarray, "3 3"],
    step: float,
    learned: Float64[np.ndarray, "2"],
) -> None:
    """Integrate roll and pitch of log(here^T goal), with the goal from the fourth number on."""
    # Trace and antisymmetric part of the rotation, 1 + 2 cos and 2 sin of its angle.
    trace = x = y = z = 0.0
    for k in range(3):
        a, b, c = here[k, 0], here[k, 1], here[k, 2]
        to_a, to_b, to_c = target[3 + 3 * k], target[4 + 3 * k], target[5 + 3 * k]
        trace += a * to_a + b * to_b + c * to_c
        x, y, z = x + c * to_b - b * to_c, y + a * to_c - c * to_a, z + b * to_a - a * to_b
    sine = math.sqrt(x * x + y * y + z * z)
    if sine > 0.0:
        ratio = math.atan2(sine, trace - 1.0) / sine
        if ratio * math.hypot(x, y) < _THROWN:
            learned[0] = min(max(learned[0] + step * ratio * x, -_MOST), _MOST)
            learned[1] = min(max(learned[1] + step * ratio * y, -_MOST), _MOST)
    for k in range(3):
        target[21 + k] = here[k, 0] * learned[0] + here[k, 1] * learned[1]
