"""`AttitudeBiasEstimator`: how far an attitude is off, by what soles push along the ground."""

import math
from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.estimation._config import AttitudeBiasBelief
from poise.robots import GRAVITY

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
        bias: phi, about the base's x and y [rad].
    """

    def __init__(self, belief: AttitudeBiasBelief | None = None) -> None:
        self.belief = belief if belief is not None else AttitudeBiasBelief()
        self.reset()

    def reset(self) -> None:
        """Forgets everything: the attitude is right."""
        self.bias: Float64[np.ndarray, "2"] = np.zeros(2)
        self._variance = self.belief.likely**2
        self._time = math.nan
        self._low: Float64[np.ndarray, "6"] | None = None

    def corrected(self, quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "4"]:
        """An attitude less its error.

        Args:
            quaternion: of the base as measured, x, y, z, w.
        """
        x, y = self.bias.tolist()
        back = pin.Quaternion(pin.exp3(np.array([-x, -y, 0.0])))
        return (pin.Quaternion(quaternion) * back).coeffs().copy()

    def update(
        self,
        time: float,
        forces: Iterable[Float64[np.ndarray, "3"] | None],
        com_velocity: Float64[np.ndarray, "3"],
        world_R_base: Float64[np.ndarray, "3 3"],
    ) -> None:
        """Learns from a state whose attitude is corrected; numbers of no use change nothing.

        Args:
            time: of the state [s].
            forces: of the soles along the world's axes [N]; None of one that measures nothing.
            com_velocity: velocity of the centre of mass [m/s].
            world_R_base: the attitude.
        """
        dt, self._time = time - self._time, time
        felt = _felt(forces, com_velocity)
        if felt is None or self._low is None or not 0.0 < dt <= _LONGEST:
            self._low = felt
            return
        b = self.belief
        self._low = self._low - math.expm1(-dt / b.smoothing) * (felt - self._low)
        self._variance += b.walk**2 * dt
        a_x, a_y, a_z = ((felt[3:] - self._low[3:]) / b.smoothing).tolist()
        f_x, f_y, f_z = self._low[:3].tolist()
        if f_z <= 0.0 or max(abs(a_x), abs(a_y), abs(a_z)) > b.shock:
            return
        part = (a_z + GRAVITY) / f_z
        left = np.array([a_y - part * f_y, part * f_x - a_x, 0.0]) / GRAVITY
        noise = b.noise * (1.0 + float(left @ left) / b.push**2)
        gain = self._variance / (self._variance + noise**2 / dt)
        self._variance -= gain * self._variance
        change = gain * (world_R_base.T @ left)[:2]
        most = b.rate * dt
        self.bias = np.clip(self.bias + np.clip(change, -most, most), -b.most, b.most)


def _felt(
    forces: Iterable[Float64[np.ndarray, "3"] | None], com_velocity: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "6"] | None:
    """Force of the soles and velocity of the centre of mass; None where something is missing."""
    felt = np.zeros(6)
    felt[3:] = com_velocity
    for force in forces:
        if force is None:
            return None
        felt[:3] += force
    return felt if np.isfinite(felt).all() else None
