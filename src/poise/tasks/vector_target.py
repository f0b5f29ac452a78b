"""`VectorTarget`: position, velocity and acceleration that a vector quantity should have."""

import numpy as np
from jaxtyping import Float64

from poise.checks import Numbers
from poise.tasks.checks import checked_target


class VectorTarget:
    """A moving target for a vector, or "where you are" until one is set.

    Attributes:
        position: wanted value, None to hold the value of the first tick.
        velocity: its rate.
        acceleration: its second rate.
    """

    def __init__(self, dim: int, what: str) -> None:
        self._dim = dim
        self._what = what
        self._held = False
        self.position: Float64[np.ndarray, " m"] | None = None
        self.velocity: Float64[np.ndarray, " m"] = np.zeros(dim)
        self.acceleration: Float64[np.ndarray, " m"] = np.zeros(dim)

    def set(
        self,
        position: Numbers,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Sets the target; rates that are not given are zero.

        Raises:
            TargetError: wrong shape, NaN or infinite.
        """
        dim, what, zero = self._dim, self._what, np.zeros(self._dim)
        new_position = checked_target(position, dim, f"target of {what}")
        new_velocity = (
            zero
            if velocity is None
            else checked_target(velocity, dim, f"target velocity of {what}")
        )
        new_acceleration = (
            zero
            if acceleration is None
            else checked_target(acceleration, dim, f"target acceleration of {what}")
        )
        self.position, self.velocity, self.acceleration = (
            new_position,
            new_velocity,
            new_acceleration,
        )
        self._held = False

    def error(self, actual: Float64[np.ndarray, " m"]) -> Float64[np.ndarray, " m"]:
        """Target minus actual; the first actual value becomes the target where none was set."""
        if self.position is None:
            self.position = actual.copy()
            self._held = True
        return self.position - actual

    def release_hold(self) -> None:
        """Forgets a target that was taken from the robot."""
        if self._held:
            self.position = None
            self._held = False
