"""`FrameKinematics`: where one frame is, how it moves, and how it answers to joint acceleration."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64


class FrameKinematics(NamedTuple):
    """Kinematics of one frame at one state.

    Spatial vectors put the linear part first and are expressed along the world's axes at the
    frame's origin (`LOCAL_WORLD_ALIGNED`). The bias is classical, so that
    `acceleration = jacobian @ dv + bias`.

    Attributes:
        position: origin of the frame in the world [m].
        rotation: world_R_frame.
        jacobian: maps `v` to the frame's velocity.
        velocity: linear [m/s] and angular [rad/s] velocity.
        bias: classical acceleration at zero `dv` [m/s^2, rad/s^2].
    """

    position: Float64[np.ndarray, "3"]
    rotation: Float64[np.ndarray, "3 3"]
    jacobian: Float64[np.ndarray, "6 nv"]
    velocity: Float64[np.ndarray, "6"]
    bias: Float64[np.ndarray, "6"]
