"""`DesiredMotion`: velocities asked of body and feet in a tick."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

POSITION_GAIN = 10.0
"""k_v of (17a) and (17c), from distances to velocities of CoM and feet [1/s]."""


@dataclass(slots=True, kw_only=True, eq=False)
class DesiredMotion:
    """v_d of (16), less what is kept level and upright by itself, and the CoM's acceleration.

    Attributes:
        com: velocity of the CoM [m/s].
        com_acceleration: of the CoM along the ground [m/s^2].
        momentum: angular, about the CoM, x and y [kg m^2/s].
        foot: velocity of the sole that is not the stance [m/s].
    """

    com: Float64[np.ndarray, "3"]
    com_acceleration: Float64[np.ndarray, "2"]
    momentum: Float64[np.ndarray, "2"]
    foot: Float64[np.ndarray, "3"]
