"""`Encoder` and `JointSensors`: what a controller is told of joints behind encoders."""

from dataclasses import dataclass
from math import isfinite, pi

import numpy as np
from jaxtyping import Float64

from poise.dynamics import RobotState
from poise.errors import ConfigurationError

_MOST_BITS = 32
"""Beyond this a count is lost in the rounding of angles behind large gears."""


@dataclass(frozen=True, kw_only=True)
class Encoder:
    """An encoder on the motor's side of a gear.

    Attributes:
        bits: the encoder tells 2^bits angles of a revolution of the motor apart.
        gear: revolutions of the motor for one of the joint.
    """

    bits: int = 17
    gear: float = 100.0

    def __post_init__(self) -> None:
        if not (isinstance(self.bits, int) and 1 <= self.bits <= _MOST_BITS):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ConfigurationError(
                "an encoder's number of bits is out of range",
                got=self.bits,
                wanted=f"a whole number from 1 to {_MOST_BITS}",
            )
        if not (isfinite(self.gear) and self.gear > 0.0):
            raise ConfigurationError(
                "an encoder's gear ratio is out of range", got=self.gear, wanted="a number > 0"
            )

    @property
    def resolution(self) -> float:
        """Smallest step of the joint's angle, 2 pi / (2^bits gear) [rad]."""
        return 2.0 * pi / (2**self.bits * self.gear)

    def read(self, q: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        """Joint angles as the encoder tells them: the nearest whole step [rad]."""
        return np.rint(q / self.resolution) * self.resolution


class JointSensors:
    """Joint angles and velocities as the controller gets them.

    Without an encoder both are exact. With one, the angle is quantised and the velocity is the
    backward difference of quantised angles, as in (Park, Jin, Kang 2022); the robot starts at rest.

    Args:
        encoder: of all joints; None for exact angles.
    """

    def __init__(self, encoder: Encoder | None = None) -> None:
        self._encoder = encoder
        self._before: tuple[float, Float64[np.ndarray, " n"]] | None = None

    def read(
        self, q: Float64[np.ndarray, " n"], v: Float64[np.ndarray, " n"], time: float
    ) -> RobotState:
        """One measurement; times must grow from call to call.

        Args:
            q: true angles [rad].
            v: true velocities [rad/s].
            time: when [s].
        """
        if self._encoder is None:
            return RobotState(q.copy(), v.copy(), time=time)
        angle = self._encoder.read(q)
        velocity = np.zeros_like(angle)
        if self._before is not None:
            last_time, last = self._before
            velocity = (angle - last) / (time - last_time)
        self._before = (time, angle)
        return RobotState(angle, velocity, time=time)
