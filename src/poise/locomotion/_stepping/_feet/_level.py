"""`Level`: torques or velocities, to which a step teleoperator turns an operator's command."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float64

from poise.control import Controller
from poise.dynamics import Dynamics, RobotState
from poise.locomotion._stepping._operator import BodyCommand, OperatorGuard, OperatorSample
from poise.locomotion._stepping._stance import Footing, ZmpSensor
from poise.locomotion._walking import Mode, StepEnd
from poise.stack import Stack


@dataclass(frozen=True, slots=True, eq=False)
class OperatorTick:
    """Command of a tick.

    Attributes:
        guard: of the devices.
        command: of the feet; None while they are lost.
        body: commanded of the body.
        torso: roll, pitch and yaw of the torso [rad].
        turns: yaw of the left and of the right foot [rad].
        upright: whether an upright torso comes first.
    """

    guard: OperatorGuard
    command: OperatorSample | None
    body: BodyCommand
    torso: tuple[float, float, float]
    turns: tuple[float, float]
    upright: bool


@dataclass(frozen=True, slots=True, eq=False)
class LevelTick:
    """Outcome of a tick.

    Attributes:
        footing: as the robot stands.
        target: where the swing foot is sent [m].
        cart_table_zmp: CT-ZMP (26) of the commanded acceleration [m].
        ended: end of the last step; None while one goes on.
        walked: whether a walk by velocity has ended in this tick.
    """

    footing: Footing
    target: Float64[np.ndarray, "3"]
    cart_table_zmp: Float64[np.ndarray, "2"]
    ended: StepEnd | None
    walked: bool = False


class Level(Protocol):
    """Leader of a stack that is solved for torques, or for velocities."""

    @property
    def stack(self) -> Stack:
        """Stack whose targets it sets."""
        ...

    @property
    def mode(self) -> Mode:
        """Feet that carry the robot."""
        ...

    def reset(self, sensor: ZmpSensor) -> None:
        """Stand on both feet as at the start.

        Args:
            sensor: of the soles.
        """
        ...

    def controller(self, dynamics: Dynamics, time_limit: float | None) -> Controller:
        """Return the controller of the stack.

        Args:
            dynamics: of the estimated state.
            time_limit: cap of one solve, None for none [s].

        Raises:
            ConfigurationError: the controller takes none.
        """
        ...

    def lead(self, state: RobotState, operator: OperatorTick) -> LevelTick:
        """Set the stack for a tick.

        Args:
            state: estimated.
            operator: command of the tick.
        """
        ...
