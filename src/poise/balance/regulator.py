"""`ZmpRegulator`: the dual of the COM shifter, from COM reference to ZMP."""

import numpy as np
from jaxtyping import Float64

from poise.checks import checked_number
from poise.errors import ConfigurationError


class ZmpRegulator:
    """Sugihara's regulator on the linear inverted pendulum, eqs (33) and (34).

        u = max(r_1, min(r_2, p_ref + k_s (p - p_ref) + b_s pdot)),   b_s = k_s / omega,  k_s > 1

    It commands the ZMP within a support from r_1 to r_2, where the COM shifter commands the COM's
    acceleration; the plant is pdd = omega^2 (p - u), eq. (32).

    Args:
        omega: sqrt(g / H) [1/s].
        ks: k_s.

    Raises:
        ConfigurationError: omega not positive, or k_s not above one.
    """

    def __init__(self, omega: float, *, ks: float = 2.0) -> None:
        self.omega = checked_number(omega, "omega of the regulator [1/s]", above=0.0)
        if not ks > 1.0:
            raise ConfigurationError("k_s of the regulator is too small", got=ks, wanted="> 1")
        self.ks, self.bs = float(ks), float(ks) / self.omega

    def zmp(
        self,
        reference: Float64[np.ndarray, " n"],
        position: Float64[np.ndarray, " n"],
        velocity: Float64[np.ndarray, " n"],
        support: tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]],
    ) -> Float64[np.ndarray, " n"]:
        """Where the ZMP should be [m].

        Args:
            reference: of the COM [m].
            position: of the COM [m].
            velocity: of the COM [m/s].
            support: r_1 and r_2 [m].
        """
        wanted = reference + self.ks * (position - reference) + self.bs * velocity
        return np.clip(wanted, *support)
