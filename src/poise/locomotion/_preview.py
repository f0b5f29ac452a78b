"""`PreviewControl`: the ZMP follows a reference that is known some time ahead."""

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.errors import ConfigurationError
from poise.locomotion._pendulum import natural_frequency
from poise.robots import GRAVITY


class PreviewControl:
    """Preview control of the ZMP on the cart-table model (Kajita et al. 2003; Kajita et al. 2014).

    With x = [p, pdot, pdd] and the jerk u as input, the cost sum Q (r_ref - r)^2 + R u^2 gives

        u_k = -K x_k + f_1 r_ref,k+1 + ... + f_N r_ref,k+N

    with K and f from the discrete Riccati equation. A window that is too short does not see the
    whole effect of a reference, which leaves a steady error: `dc_gain` says how much.

    Args:
        height: of the COM [m].
        dt: length of a tick [s].
        length: N, ticks that the reference is known ahead.
        Q: weight of the ZMP error [1/m^2].
        R: weight of the jerk [s^6/m^2].
        gravity: [m/s^2].

    Raises:
        ConfigurationError: a number that is not positive, or a length below one.

    Attributes:
        omega: sqrt(g / H) [1/s].
        K: feedback gains on [p, pdot, pdd].
        f: preview gains, f_1 first.
    """

    def __init__(
        self,
        height: float,
        dt: float,
        length: int,
        *,
        Q: float = 1.0,
        R: float = 1e-6,
        gravity: float = GRAVITY,
    ) -> None:
        self.omega = natural_frequency(height, gravity)
        dt = checked_number(dt, "dt of the preview control [s]", above=0.0)
        checked_number(Q, "Q of the preview control", above=0.0)
        checked_number(R, "R of the preview control", above=0.0)
        if length < 1:
            raise ConfigurationError(
                "the preview control looks no tick ahead", got=length, wanted="at least one"
            )
        self.length = length
        self.A: Float64[np.ndarray, "3 3"] = np.array(
            [[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]]
        )
        self.b: Float64[np.ndarray, "3"] = np.array([dt**3 / 6.0, 0.5 * dt * dt, dt])
        self.c: Float64[np.ndarray, "3"] = np.array([1.0, 0.0, -1.0 / self.omega**2])
        # SciPy takes long to import, and who only imports the package may need no preview.
        from scipy.linalg import solve_discrete_are

        P = solve_discrete_are(
            self.A, self.b[:, None], Q * np.outer(self.c, self.c), np.array([[R]])
        )
        scale = 1.0 / (R + self.b @ P @ self.b)
        self.K: Float64[np.ndarray, "3"] = scale * (self.b @ P @ self.A)
        closed = self.A - np.outer(self.b, self.K)
        self.f: Float64[np.ndarray, " N"] = np.zeros(length)
        ahead = Q * self.c
        for i in range(length):
            self.f[i] = scale * (self.b @ ahead)
            ahead = closed.T @ ahead

    @property
    def dc_gain(self) -> float:
        """Where the ZMP settles for a reference of one; one for an endless window."""
        closed = self.A - np.outer(self.b, self.K)
        return float(self.f.sum() * (self.c @ np.linalg.solve(np.eye(3) - closed, self.b)))

    def jerk(
        self, state: Float64[np.ndarray, "3 n"], reference: Float64[np.ndarray, "N n"]
    ) -> Float64[np.ndarray, " n"]:
        """The COM's jerk [m/s^3].

        Args:
            state: position, velocity, acceleration of the COM, a column an axis.
            reference: of the ZMP from the next tick on, a row a tick [m].
        """
        return self.f @ reference - self.K @ state

    def advance(
        self, state: Float64[np.ndarray, "3 n"], jerk: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, "3 n"]:
        """The state one tick later; exact for a jerk that stays the same."""
        return self.A @ state + np.outer(self.b, jerk)
