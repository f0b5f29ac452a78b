"""`RobotState`: the one thing a controller is told each tick."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64


@dataclass(frozen=True, slots=True)
class RobotState:
    """Where the robot is and how fast, as measured or estimated.

    Not validated when made, because it is made every tick: a controller checks it for NaN and
    answers with a status.

    Attributes:
        q: configuration as Pinocchio orders it: base position in the world [m], base quaternion
            (x, y, z, w), joints [rad]; joints alone for a fixed base.
        v: velocity: base linear [m/s] and angular [rad/s] in the base frame, joints [rad/s].
        contacts: measured wrench [force; moment] on the robot by sole name, in the sole's frame at
            the sole's centre [N, N m]; empty where nothing is measured.
        time: time of the measurement [s].
    """

    q: Float64[np.ndarray, " nq"]
    v: Float64[np.ndarray, " nv"]
    contacts: Mapping[str, Float64[np.ndarray, "6"]] = field(default_factory=dict)
    time: float = 0.0
