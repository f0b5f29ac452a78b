"""Control of the ZMP on the cart-flywheel-table: `ComShifter`, `BodyRotator`, `PreviewControl`."""

import math

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.errors import ConfigurationError
from poise.robots import GRAVITY


def natural_frequency(height: float, gravity: float = GRAVITY) -> float:
    """Omega = sqrt(g / H) [1/s]."""
    checked_number(height, "height of the table [m]", above=0.0)
    return math.sqrt(checked_number(gravity, "gravity of the table [m/s^2]", above=0.0) / height)


def pole_zero_damping(kp: float, omega: float) -> float:
    """k_d = k_p / omega + omega, eqs (30) and (38): cancels the slower pole against a zero."""
    if not kp > omega * omega:
        raise ConfigurationError(
            "k_p of the CoM shifter is too small for its table",
            got=kp,
            wanted=f"more than omega^2 = {omega * omega:.4g} /s^2",
        )
    return kp / omega + omega


class ComShifter:
    """A feedback from ZMP reference to CoM acceleration, eqs (25a) and (37) of Zhang and Kikuuwe.

        a = sat(a_lim, k_p (r_ref - p) - k_d pdot)     each axis by itself

    No preview, no buffer: the reference may jump. While a is not saturated the CoM follows by
    (27), and the ZMP of the cart-table model by (28), which under the gain rule (30) is first order
    after the initial undershoot.

    Args:
        height: of the CoM [m].
        kp: k_p [1/s^2].
        kd: k_d [1/s]; by the gain rule (30) when None.
        acceleration_max: a_lim [m/s^2].
        gravity: [m/s^2].

    Raises:
        ConfigurationError: k_p <= omega^2, or a number that is not positive.

    Attributes:
        omega: sqrt(g / H) [1/s].
    """

    def __init__(
        self,
        height: float,
        *,
        kp: float = 40.0,
        kd: float | None = None,
        acceleration_max: float = 0.8,
        gravity: float = GRAVITY,
    ) -> None:
        self.omega = natural_frequency(height, gravity)
        self.kp = checked_number(kp, "k_p of the CoM shifter [1/s^2]", above=0.0)
        rule = pole_zero_damping(self.kp, self.omega)
        self.kd = rule if kd is None else checked_number(kd, "k_d of the CoM shifter [1/s]")
        self.acceleration_max = checked_number(
            acceleration_max, "acceleration_max of the CoM shifter [m/s^2]", above=0.0
        )

    def acceleration(
        self,
        reference: Float64[np.ndarray, " n"],
        position: Float64[np.ndarray, " n"],
        velocity: Float64[np.ndarray, " n"],
    ) -> Float64[np.ndarray, " n"]:
        """The CoM's acceleration.

        Args:
            reference: of the ZMP [m].
            position: of the CoM [m].
            velocity: of the CoM [m/s].
        """
        unlimited = self.unlimited(reference, position, velocity)
        return np.clip(unlimited, -self.acceleration_max, self.acceleration_max)

    def unlimited(
        self,
        reference: Float64[np.ndarray, " n"],
        position: Float64[np.ndarray, " n"],
        velocity: Float64[np.ndarray, " n"],
    ) -> Float64[np.ndarray, " n"]:
        """The CoM's acceleration before saturation.

        Under the gain rule its CT-ZMP is r_ref + k_s (xi - r_ref) with the DCM
        xi = p + pdot / omega and k_s = 1 + k_p / omega^2: Sugihara's regulator, eq. (33), without
        its limits.

        Args:
            reference: of the ZMP [m].
            position: of the CoM [m].
            velocity: of the CoM [m/s].
        """
        return self.kp * (reference - position) - self.kd * velocity

    def cart_table_zmp(
        self, position: Float64[np.ndarray, " n"], acceleration: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " n"]:
        """CT-ZMP, eq. (26): the ZMP at zero rate of angular momentum, p - a / omega^2 [m].

        Args:
            position: of the CoM [m].
            acceleration: of the CoM [m/s^2].
        """
        return position - acceleration / self.omega**2


class BodyRotator:
    """The rate of angular momentum that puts the ZMP on its reference, eq. (39a).

        Ldot_x =  m g (r_ref,y - rhat_y)
        Ldot_y = -m g (r_ref,x - rhat_x)     with rhat the CT-ZMP

    In (24) that is u_2 = W (rhat - r_ref), the negative of (25b) as printed, which gives
    r = 2 rhat - r_ref.

    It cannot act for ever: the body would turn. What uses it decides when.
    """

    def __init__(self, weight: float) -> None:
        self.weight = checked_number(weight, "weight of the body rotator [N]", above=0.0)

    def momentum_rate(
        self, reference: Float64[np.ndarray, "2"], cart_table_zmp: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """Rate of the angular momentum about the CoM, x and y [N m]."""
        x, y = (reference - cart_table_zmp).tolist()
        return self.weight * np.array([y, -x])


class PreviewControl:
    """Preview control of the ZMP on the cart-table model (Kajita et al. 2003; Kajita et al. 2014).

    With x = [p, pdot, pdd] and the jerk u as input, the cost sum Q (r_ref - r)^2 + R u^2 gives

        u_k = -K x_k + f_1 r_ref,k+1 + ... + f_N r_ref,k+N

    with K and f from the discrete Riccati equation. A window that is too short does not see the
    whole effect of a reference, which leaves a steady error, given by `dc_gain`.

    Args:
        height: of the CoM [m].
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
        """Steady ZMP for a reference of one; one for an endless window."""
        closed = self.A - np.outer(self.b, self.K)
        return float(self.f.sum() * (self.c @ np.linalg.solve(np.eye(3) - closed, self.b)))

    def jerk(
        self, state: Float64[np.ndarray, "3 n"], reference: Float64[np.ndarray, "N n"]
    ) -> Float64[np.ndarray, " n"]:
        """The CoM's jerk [m/s^3].

        Args:
            state: position, velocity, acceleration of the CoM, a column an axis.
            reference: of the ZMP from the next tick on, a row a tick [m].
        """
        return self.f @ reference - self.K @ state

    def advance(
        self, state: Float64[np.ndarray, "3 n"], jerk: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, "3 n"]:
        """The state one tick later; exact for a jerk that stays the same."""
        return self.A @ state + np.outer(self.b, jerk)
