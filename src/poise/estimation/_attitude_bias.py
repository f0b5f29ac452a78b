"""`AttitudeBiasEstimator`: how far an attitude is off, by what soles push along the ground."""

import math
from collections.abc import Iterable
from dataclasses import astuple

import numpy as np
from jaxtyping import Float64

from poise._compiled import Block, allocate, compiled, view
from poise.estimation._config import AttitudeBiasBelief
from poise.robots import GRAVITY

_TINY = 1e-9
"""Half the sine of a smaller angle is half the angle, to the last bit [rad]."""

_LONGEST = 0.05
"""A clock that jumps farther says nothing of what happened meanwhile [s]."""


_LIKELY, _WALK, _NOISE, _SMOOTHING, _SHOCK, _PUSH, _RATE, _MOST = range(8)
"""Numbers of `AttitudeBiasBelief`, in its order."""


class AttitudeMemory(Block):
    """Memory of an `AttitudeBiasEstimator`."""

    belief: Float64[np.ndarray, " numbers"]  # numbers of `AttitudeBiasBelief`
    felt: Float64[np.ndarray, "6"]  # force of the soles [N], velocity of the COM [m/s]
    low: Float64[np.ndarray, "6"]  # the same, smoothed
    rate: Float64[np.ndarray, "6"]  # scratch: how fast they change
    world_R_base: Float64[np.ndarray, "3 3"]
    bias: Float64[np.ndarray, "2"]  # phi, about the base's x and y [rad]
    variance: Float64[np.ndarray, "1"]  # of either [rad^2]


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
        self._memory = allocate(
            AttitudeMemory, {str(n): n for n in (1, 2, 3, 6)}, belief=np.array(astuple(self.belief))
        )
        # What is compiled is compiled now, not in the first tick.
        _learn(self._memory.address, 0.0)
        self.reset()

    def reset(self) -> None:
        """Forgets everything: the attitude is right."""
        self._memory.bias[:] = 0.0
        self._memory.variance[0] = self.belief.likely**2
        self._time = math.nan

    @property
    def bias(self) -> Float64[np.ndarray, "2"]:
        """Phi, about the base's x and y [rad]."""
        return self._memory.bias.copy()

    def corrected(self, quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "4"]:
        """An attitude less its error.

        Args:
            quaternion: of the base as measured, x, y, z, w.
        """
        x, y, z, w = quaternion.tolist()
        a, b = self._memory.bias.tolist()
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
        felt = None if time == self._time else _felt(forces, com_velocity)
        if felt is None:
            return
        m, dt, self._time = self._memory, time - self._time, time
        m.felt[:], m.world_R_base[:] = felt, world_R_base
        _learn(m.address, dt if 0.0 < dt <= _LONGEST else 0.0)


@compiled
def _learn(address: int, dt: float) -> None:
    """Take in `felt`; without a time that has passed it is where the low-pass begins."""
    m = view(AttitudeMemory, address)
    b, low, R, bias = m.belief, m.low, m.world_R_base, m.bias
    step = -math.expm1(-dt / b[_SMOOTHING]) if dt > 0.0 else 1.0
    for i in range(6):
        low[i] = low[i] + step * (m.felt[i] - low[i]) if dt > 0.0 else m.felt[i]
        m.rate[i] = (m.felt[i] - low[i]) / b[_SMOOTHING]
    if dt == 0.0:
        return
    m.variance[0] += b[_WALK] ** 2 * dt
    a_x, a_y, a_z = m.rate[3], m.rate[4], m.rate[5]
    if low[2] <= 0.0 or max(abs(a_x), abs(a_y), abs(a_z)) > b[_SHOCK]:
        return
    part = (a_z + GRAVITY) / low[2]
    left_x, left_y = (a_y - part * low[1]) / GRAVITY, (part * low[0] - a_x) / GRAVITY
    noise = b[_NOISE] * (1.0 + (left_x * left_x + left_y * left_y) / b[_PUSH] ** 2)
    gain = m.variance[0] / (m.variance[0] + noise**2 / dt)
    m.variance[0] -= gain * m.variance[0]
    most = b[_RATE] * dt
    for i in range(2):
        change = gain * (R[0, i] * left_x + R[1, i] * left_y)
        found = bias[i] + min(max(change, -most), most)
        bias[i] = min(max(found, -b[_MOST]), b[_MOST])


def _felt(
    forces: Iterable[Float64[np.ndarray, "3"] | None], com_velocity: Float64[np.ndarray, "3"]
) -> list[float] | None:
    """Force of the soles and velocity of the centre of mass; None where something is missing."""
    x = y = z = 0.0
    for force in forces:
        if force is None:
            return None
        f_x, f_y, f_z = force.tolist()
        x, y, z = x + f_x, y + f_y, z + f_z
    felt = [x, y, z, *com_velocity.tolist()]
    return felt if math.isfinite(sum(felt)) else None
