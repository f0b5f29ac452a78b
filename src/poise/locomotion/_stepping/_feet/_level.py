"""`Level`: torques or velocities, to which a step teleoperator turns an operator's command."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from jaxtyping import Float64

from poise.control import Controller
from poise.dynamics import Dynamics, RobotState
from poise.locomotion._single_support import SingleSupportRegion
from poise.locomotion._stepping._operator import BodyCommand, OperatorGuard, OperatorSample
from poise.locomotion._stepping._stance import (
    Biped,
    Footing,
    FootRange,
    StanceChoice,
    StanceEstimator,
    TeleopParameters,
    ZmpSensor,
)
from poise.locomotion._support import SolePart
from poise.locomotion._walking import Mode, StepEnd
from poise.stack import Stack


@dataclass(slots=True, eq=False)
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


class LevelTick(NamedTuple):
    """Outcome of a tick.

    Attributes:
        target: where the swing foot is sent [m].
        zmp_reference: where the ZMP should be [m].
        cart_table_zmp: CT-ZMP (26) of the commanded acceleration [m].
        ended: end of the last step; None while one goes on, and before the first.
    """

    target: Float64[np.ndarray, "3"]
    zmp_reference: Float64[np.ndarray, "2"]
    cart_table_zmp: Float64[np.ndarray, "2"]
    ended: StepEnd | None


class LevelTasks(Protocol):
    """Tasks of a level.

    Attributes:
        stack: that they belong to.
    """

    stack: Stack

    def reset(self) -> None:
        """Stand on both feet as at the start."""
        ...

    def controller(self, dynamics: Dynamics, time_limit: float | None) -> Controller:
        """Return the controller of the stack."""
        ...


class Level(ABC):
    """Leader of a stack that is solved for torques, or for velocities.

    Attributes:
        stack: whose targets it sets.
        footing: of the last tick; None before the first.
    """

    def __init__(
        self,
        biped: Biped,
        parameters: TeleopParameters,
        reach: FootRange,
        estimator: StanceEstimator,
        tasks: LevelTasks,
    ) -> None:
        self._biped, self._parameters, self._reach = biped, parameters, reach
        self._estimator, self._all_tasks, self.stack = estimator, tasks, tasks.stack
        self.footing: Footing | None = None

    def reset(self, sensor: ZmpSensor) -> None:
        """Stand on both feet as at the start.

        Args:
            sensor: of the soles.
        """
        self._sensor, self.footing = sensor, None
        self._all_tasks.reset()
        self._stance = StanceChoice(self._estimator, sensor, self._parameters, self._biped.weight)

    def controller(self, time_limit: float | None) -> Controller:
        """Return the controller of the stack.

        Args:
            time_limit: cap of one solve, None for none [s].

        Raises:
            ConfigurationError: the controller takes none.
        """
        return self._all_tasks.controller(self._estimator.dynamics, time_limit)

    @property
    @abstractmethod
    def mode(self) -> Mode:
        """Feet that carry the robot."""

    @abstractmethod
    def outcome(self, footing: Footing) -> LevelTick:
        """Return the outcome of the last tick, before the next one begins.

        Args:
            footing: of that tick.
        """

    @abstractmethod
    def lead(self, state: RobotState, operator: OperatorTick) -> bool:
        """Set the stack for a tick; return whether a walk by velocity has ended in it.

        Args:
            state: estimated.
            operator: command of the tick.
        """

    def _stand(
        self,
        omega: float,
        region: SingleSupportRegion,
        *,
        has_left: bool,
        parts: Sequence[SolePart | None] = (None, None),
        com_velocity: Float64[np.ndarray, "2"] | None = None,
    ) -> Footing:
        estimator = self._estimator
        return Footing(
            biped=self._biped,
            dynamics=estimator.dynamics,
            mode=self.mode,
            stance=estimator.stance,
            anchors=estimator.anchors,
            omega=omega,
            region=region,
            sensor=self._sensor,
            pressed=self._stance.pressed,
            parts=parts,
            com_velocity=com_velocity,
            has_left=has_left,
        )
