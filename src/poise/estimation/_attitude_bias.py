"""`AttitudeBiasEstimator`: how far an attitude is off, by what soles push along the ground."""

import math

import numpy as np
from jaxtyping import Float64

from poise.estimation._config import AttitudeBiasBelief
from poise.robots import GRAVITY

_TINY = 1e-9
"""Half the sine of a smaller angle is half the angle, to the last bit [rad]."""

_LONGEST = 0.05
"""A clock that jumps farther says nothing of what happened meanwhile [s]."""


class AttitudeBiasEstimator:
    """The constant error of an attitude, as a slow and bounded random walk.

    Where the base is taken to be turned by a small phi against how it is, all that follows from it
    is turned, too: also the sum F of the soles' forces, which seem to push along the ground and
    move nothing. With a the acceleration of the centre of mass, x, y, z in the world as it is taken
    to be,

        (F_x, F_y) (a_z + g) / F_z - (a_x, a_y) = g (phi_y, -phi_x)

    whatever the robot weighs and however its ground slopes. A Kalman filter follows phi along the
    base's axes, about which a unit that is mounted askew is turned. Both sides go through one
    low-pass, so that an acceleration is a difference to it, a = (v - v_low) / smoothing, and
    nothing is differentiated.

    Somebody who pushes along the ground as steadily looks like an error of the attitude; then the
    robot leans against the push, which holds it. Of sudden pushes little is believed. Load cells
    that are off along the ground by a part of the weight look like an error of as many radians.

    Args:
        belief: what it believes.

    Attributes:
        belief: what it believes.
    """

    def __init__(self, belief: AttitudeBiasBelief | None = None) -> None:
        self.belief = belief if belief is not None else AttitudeBiasBelief()
        self.reset()

    def reset(self) -> None:
        """Forgets everything: the attitude is right."""
        self._bias = (0.0, 0.0)
        self._variance = self.belief.likely**2
        self._time = math.nan
        self._low: list[float] | None = None

    @property
    def bias(self) -> Float64[np.ndarray, "2"]:
        """Phi, about the base's x and y [rad]."""
        return np.array(self._bias)

    def corrected(self, quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "4"]:
        """An attitude less its error.

        Args:
            quaternion: of the base as measured, x, y, z, w.
        """
        x, y, z, w = quaternion.tolist()
        a, b = self._bias
        angle = math.hypot(a, b)
        # Of the turn by -phi: its quaternion's real part, and what of -phi its imaginary part is.
        c, part = math.cos(0.5 * angle), -0.5
        if angle > _TINY:
            part = -math.sin(0.5 * angle) / angle
        a, b = part * a, part * b
        return np.array(
            [
                w * a + x * c - z * b,
                w * b + y * c + z * a,
                z * c + x * b - y * a,
                w * c - x * a - y * b,
            ]
        )

    def update(
        self,
        time: float,
        force: Float64[np.ndarray, "3"] | None,
        com_velocity: Float64[np.ndarray, "3"],
        world_R_base: Float64[np.ndarray, "3 3"],
    ) -> None:
        """Learns from a state whose attitude is corrected; numbers of no use change nothing.

        Args:
            time: of the state [s].
            force: of all soles along the world's axes, in any unit; None if one measures nothing.
            com_velocity: velocity of the centre of mass [m/s].
            world_R_base: the attitude.
        """
        dt = time - self._time
        if dt == 0.0 or force is None:
            return
        felt = [*force.tolist(), *com_velocity.tolist()]
        if not math.isfinite(sum(felt)):
            return
        self._time = time
        if self._low is None or not 0.0 < dt <= _LONGEST:
            self._low = felt
            return
        b = self.belief
        # A few numbers are several times as quick as such than as arrays.
        step = -math.expm1(-dt / b.smoothing)
        pairs = zip(self._low, felt, strict=True)
        low = self._low = [old + step * (new - old) for old, new in pairs]
        self._variance += b.walk**2 * dt
        f_x, f_y, f_z, v_x, v_y, v_z = low
        a_x, a_y, a_z = felt[3] - v_x, felt[4] - v_y, felt[5] - v_z
        a_x, a_y, a_z = a_x / b.smoothing, a_y / b.smoothing, a_z / b.smoothing
        if f_z <= 0.0 or max(abs(a_x), abs(a_y), abs(a_z)) > b.shock:
            return
        part = (a_z + GRAVITY) / f_z
        left_x, left_y = (a_y - part * f_y) / GRAVITY, (part * f_x - a_x) / GRAVITY
        noise = b.noise * (1.0 + (left_x * left_x + left_y * left_y) / b.push**2)
        gain = self._variance / (self._variance + noise**2 / dt)
        self._variance -= gain * self._variance
        (along_x, along_y, _), (across_x, across_y, _), _ = world_R_base.tolist()
        (x, y), most = self._bias, b.rate * dt
        x += min(max(gain * (along_x * left_x + across_x * left_y), -most), most)
        y += min(max(gain * (along_y * left_x + across_y * left_y), -most), most)
        self._bias = (min(max(x, -b.most), b.most), min(max(y, -b.most), b.most))
