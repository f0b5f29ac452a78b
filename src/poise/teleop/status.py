"""`TeleopStatus`: how the last tick of the step teleoperator stood."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.teleop.device import DeviceStatus
from poise.teleop.modes import Mode


@dataclass(frozen=True, slots=True, eq=False)
class TeleopStatus:
    """How the last tick stood.

    Attributes:
        mode: which feet carry the robot.
        device: what became of the operator's last sample.
        zmp: measured, x and y [m].
        zmp_reference: likewise.
        cart_table_zmp: CT-ZMP, likewise.
        com: estimated [m].
        soles: where the soles are, left and right [m].
        target: where the foot in the air is sent, None with both on the ground [m].
        loads: normal forces, left and right [N].
        tilt: angle of the torso against upright [rad].
    """

    mode: Mode
    device: DeviceStatus
    zmp: Float64[np.ndarray, "2"]
    zmp_reference: Float64[np.ndarray, "2"]
    cart_table_zmp: Float64[np.ndarray, "2"]
    com: Float64[np.ndarray, "3"]
    soles: tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]
    target: Float64[np.ndarray, "3"] | None
    loads: Float64[np.ndarray, "2"]
    tilt: float
