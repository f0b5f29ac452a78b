"""`CartFlywheelTable`: the smallest model of a biped whose ZMP one controls, eq. (24)."""

import math

import numpy as np
from jaxtyping import Float64

from poise.errors import ConfigurationError


class CartFlywheelTable:
    """Cart and flywheel on a table, eq. (24) of Zhang and Kikuuwe, in as many axes as `p` has.

        pdd = u_1,   Ldot = u_2,   r = p - u_1 / omega^2 - u_2 / W

    p is the CoM, r the ZMP, L the angular momentum about the CoM in the sense that moves the ZMP
    back (for a robot that walks along x, L is -L_Gx for the axis y and L_Gy for the axis x). With
    u_2 = 0 it is the cart-table model.
    """

    def __init__(
        self,
        height: float,
        mass: float,
        position: Float64[np.ndarray, " n"],
        gravity: float = 9.81,
    ) -> None:
        if not (height > 0.0 and mass > 0.0 and gravity > 0.0):
            raise ConfigurationError(
                "height, mass or gravity of the cart-table model is out of range",
                got=(height, mass, gravity),
                wanted="three numbers > 0",
            )
        self.omega = math.sqrt(gravity / height)  # sqrt(g / H) [1/s]
        self.weight = mass * gravity  # W = m g [N]
        self.position = position.copy()  # p [m]
        self.velocity = np.zeros_like(position)  # pdot [m/s]
        self.momentum = np.zeros_like(position)  # L [kg m^2/s]
        self.zmp = position.copy()  # r under the last inputs [m]

    def step(
        self,
        acceleration: Float64[np.ndarray, " n"],
        momentum_rate: Float64[np.ndarray, " n"],
        dt: float,
    ) -> None:
        """Moves on under inputs that stay the same for a while; exact."""
        self.zmp = self.position - acceleration / self.omega**2 - momentum_rate / self.weight
        self.position = self.position + dt * self.velocity + (0.5 * dt * dt) * acceleration
        self.velocity = self.velocity + dt * acceleration
        self.momentum = self.momentum + dt * momentum_rate
