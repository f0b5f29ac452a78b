"""`BodyRotator`: angular momentum that makes up for what the cart-table model lacks."""

import numpy as np
from jaxtyping import Float64

from poise.checks import checked_number


class BodyRotator:
    """The rate of angular momentum that puts the ZMP on its reference, eqs (25b) and (39a).

        Ldot_x =  m g (r_ref,y - rhat_y)
        Ldot_y = -m g (r_ref,x - rhat_x)     with rhat the CT-ZMP

    It cannot act for ever: the body would turn. What uses it decides when.

    Args:
        weight: m g [N].

    Raises:
        ConfigurationError: not positive.
    """

    def __init__(self, weight: float) -> None:
        self.weight = checked_number(weight, "weight of the body rotator [N]", above=0.0)

    def momentum_rate(
        self, reference: Float64[np.ndarray, "2"], cart_table_zmp: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """Rate of the angular momentum about the COM, x and y [N m].

        Args:
            reference: of the ZMP, x and y [m].
            cart_table_zmp: the CT-ZMP, x and y [m].
        """
        x, y = (reference - cart_table_zmp).tolist()
        return self.weight * np.array([y, -x])
