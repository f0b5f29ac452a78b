"""`AttitudeBiasEstimator`: constant error of an attitude, by the tangential contact forces."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import Block, allocate, compiled, view
from poise.estimation._config import AttitudeBiasBelief
from poise.robots import GRAVITY

_TINY = 1e-9
"""Half the sine of a smaller angle is half the angle, to the last bit [rad]."""

_LONGEST = 0.05
"""A clock that jumps farther says nothing of what happened meanwhile [s]."""


# Where the numbers of `_Memory.belief` stand.
_SMOOTHING, _WALK, _SHOCK, _NOISE, _PUSH, _RATE, _MOST = range(7)


class _Memory(Block):
    belief: Float64[np.ndarray, " numbers"]
    bias: Float64[np.ndarray, "2"]  # about the base's x and y [rad]
    variance: Float64[np.ndarray, "1"]  # [rad^2]
    measured: Float64[np.ndarray, "6"]  # force of the soles, and velocity of the CoM [m/s]
    low: Float64[np.ndarray, "6"]  # `measured`, smoothed
    world_R_base: Float64[np.ndarray, "3 3"]


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

    Attributes:
        belief: what it believes.
    """

    def __init__(self, belief: AttitudeBiasBelief | None = None) -> None:
        self.belief = b = belief if belief is not None else AttitudeBiasBelief()
        believed = (b.smoothing, b.walk, b.shock, b.noise, b.push, b.rate, b.most)
        sizes = {str(n): n for n in (1, 2, 3, 6)}
        self._memory = allocate(_Memory, sizes, belief=np.array(believed))
        # What is compiled is compiled now, not in the first tick.
        _learn(self._memory.address, 0.0)
        self.reset()

    def reset(self) -> None:
        """Restart with an attitude that is right."""
        self._memory.bias[:], self._memory.variance[0] = 0.0, self.belief.likely**2
        self._time = math.nan

    @property
    def bias(self) -> Float64[np.ndarray, "2"]:
        """Phi, about the base's x and y [rad]."""
        return self._memory.bias.copy()

    def corrected(self, quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "4"]:
        """Return an attitude less its error."""
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
        force: Float64[np.ndarray, "3"] | None,
        com_velocity: Float64[np.ndarray, "3"],
        world_R_base: Float64[np.ndarray, "3 3"],
    ) -> None:
        """Update by a state with a corrected attitude; numbers of no use change nothing."""
        dt = time - self._time
        if dt == 0.0 or force is None:
            return
        m = self._memory
        m.measured[:3], m.measured[3:], m.world_R_base[:] = force, com_velocity, world_R_base
        if _learn(m.address, dt if 0.0 < dt <= _LONGEST else 0.0):
            self._time = time


@compiled
def _learn(address: int, dt: float) -> bool:
    """Go on by a time, or begin anew with none; False for what is not finite."""
    m = view(_Memory, address)
    measured, low, bias, R = m.measured, m.low, m.bias, m.world_R_base
    b = m.belief
    smoothing, push = b[_SMOOTHING], b[_PUSH]
    for i in range(6):
        if not abs(measured[i]) < math.inf:
            return False
    step = -math.expm1(-dt / smoothing) if dt > 0.0 else 1.0
    for i in range(6):
        low[i] = low[i] + step * (measured[i] - low[i]) if dt > 0.0 else measured[i]
    m.variance[0] += b[_WALK] * b[_WALK] * dt
    a_x, a_y, a_z = measured[3] - low[3], measured[4] - low[4], measured[5] - low[5]
    a_x, a_y, a_z = a_x / smoothing, a_y / smoothing, a_z / smoothing
    if dt == 0.0 or low[2] <= 0.0 or max(abs(a_x), abs(a_y), abs(a_z)) > b[_SHOCK]:
        return True
    part = (a_z + GRAVITY) / low[2]
    left_x, left_y = (a_y - part * low[1]) / GRAVITY, (part * low[0] - a_x) / GRAVITY
    noise = b[_NOISE] * (1.0 + (left_x * left_x + left_y * left_y) / (push * push))
    gain = m.variance[0] / (m.variance[0] + noise * noise / dt)
    m.variance[0] -= gain * m.variance[0]
    for i in range(2):
        change, most = gain * (R[0, i] * left_x + R[1, i] * left_y), b[_RATE] * dt
        changed = bias[i] + min(max(change, -most), most)
        bias[i] = min(max(changed, -b[_MOST]), b[_MOST])
    return True
