"""`ComShifter`: moves the centre of mass so that the ZMP gets where it should, soon.

`BodyRotator`: angular momentum that makes up for what the cart-table model lacks.
"""

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
    """k_d = k_p / omega + omega, eqs (30) and (38): cancels the slower pole against a zero.

    The ZMP then converges as fast as it can without overshoot.
    """
    if not kp > omega * omega:
        raise ConfigurationError(
            "k_p of the COM shifter is too small for its table",
            got=kp,
            wanted=f"more than omega^2 = {omega * omega:.4g} /s^2",
        )
    return kp / omega + omega


class ComShifter:
    """A feedback from ZMP reference to COM acceleration, eqs (25a) and (37) of Zhang and Kikuuwe.

        a = sat(a_lim, k_p (r_ref - p) - k_d pdot)     each axis by itself

    No preview, no buffer: the reference may jump. While a is not saturated the COM follows by
    (27), and the ZMP of the cart-table model by (28), which under the gain rule (30) is first order
    after the first swing to the other side.

    Args:
        height: of the COM [m].
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
        self.kp = checked_number(kp, "k_p of the COM shifter [1/s^2]", above=0.0)
        rule = pole_zero_damping(self.kp, self.omega)
        self.kd = rule if kd is None else checked_number(kd, "k_d of the COM shifter [1/s]")
        self.acceleration_max = checked_number(
            acceleration_max, "acceleration_max of the COM shifter [m/s^2]", above=0.0
        )

    def acceleration(
        self,
        reference: Float64[np.ndarray, " n"],
        position: Float64[np.ndarray, " n"],
        velocity: Float64[np.ndarray, " n"],
    ) -> Float64[np.ndarray, " n"]:
        """The COM's acceleration.

        Args:
            reference: of the ZMP [m].
            position: of the COM [m].
            velocity: of the COM [m/s].
        """
        unlimited = self.unlimited(reference, position, velocity)
        return np.clip(unlimited, -self.acceleration_max, self.acceleration_max)

    def unlimited(
        self,
        reference: Float64[np.ndarray, " n"],
        position: Float64[np.ndarray, " n"],
        velocity: Float64[np.ndarray, " n"],
    ) -> Float64[np.ndarray, " n"]:
        """The COM's acceleration before saturation.

        Under the gain rule its CT-ZMP is r_ref + k_s (xi - r_ref) with the divergent component
        xi = p + pdot / omega and k_s = 1 + k_p / omega^2: Sugihara's regulator, eq. (33), without
        its limits.

        Args:
            reference: of the ZMP [m].
            position: of the COM [m].
            velocity: of the COM [m/s].
        """
        return self.kp * (reference - position) - self.kd * velocity

    def cart_table_zmp(
        self, position: Float64[np.ndarray, " n"], acceleration: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " n"]:
        """CT-ZMP, eq. (26): where the ZMP were without angular momentum, p - a / omega^2 [m].

        Args:
            position: of the COM [m].
            acceleration: of the COM [m/s^2].
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
        """Rate of the angular momentum about the COM, x and y [N m]."""
        x, y = (reference - cart_table_zmp).tolist()
        return self.weight * np.array([y, -x])
