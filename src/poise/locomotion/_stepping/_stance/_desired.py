"""`DesiredMotion`: what a tick of the step teleoperator asks of body and feet.

`StepTasks`: who asks a stack for it, of velocities or of torques.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float64

from poise.control import Controller
from poise.dynamics import Dynamics
from poise.locomotion._stepping._stance._footing import Footing
from poise.stack import Stack


@dataclass(slots=True, kw_only=True, eq=False)
class DesiredMotion:
    """v_d of (16), less what is kept level and upright by itself, and the COM's acceleration.

    Attributes:
        com: velocity of the COM [m/s].
        com_acceleration: of the COM along the ground [m/s^2].
        momentum: angular, about the COM, x and y [kg m^2/s].
        foot: velocity of the sole that is not the stance [m/s].
        foot_place: where that is sent [m].
        torso: roll, pitch and yaw against upright and facing as the feet do [rad].
        turns: how the feet shall be turned, left and right [rad].
    """

    com: Float64[np.ndarray, "3"]
    com_acceleration: Float64[np.ndarray, "2"]
    momentum: Float64[np.ndarray, "2"]
    foot: Float64[np.ndarray, "3"]
    foot_place: Float64[np.ndarray, "3"]
    torso: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turns: tuple[float, float] = (0.0, 0.0)


class StepTasks(Protocol):
    """The tasks and contacts that a desired motion becomes.

    Attributes:
        stack: what they are in.
    """

    stack: Stack

    def reset(self) -> None:
        """Both feet stand as at the start."""
        ...

    def controller(self, dynamics: Dynamics, time_limit: float | None) -> Controller:
        """Solves the stack.

        Args:
            dynamics: of the estimated state.
            time_limit: cap of one solve, None for none [s].

        Raises:
            ConfigurationError: the controller takes none.
        """
        ...

    def ask(self, footing: Footing, desired: DesiredMotion, *, upright: bool) -> None:
        """Sets contacts and references for a tick.

        Args:
            footing: of the tick.
            desired: of body and feet.
            upright: whether the operator asks for an upright torso.
        """
        ...
