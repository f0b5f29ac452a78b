"""`Level`: torques or velocities, to which a step teleoperator turns an operator's command."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol, runtime_checkable

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


@runtime_checkable
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

    @abstractmethod
    def reset(self, sensor: ZmpSensor) -> None:
        """Stand on both feet as at the start.

        Args:
            sensor: of the soles.
        """

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

    def _begin(self, sensor: ZmpSensor, omega: float, region: SingleSupportRegion) -> None:
        """Stand on both feet as at the start, over what stays the same of each `Footing`."""
        estimator, biped = self._estimator, self._biped
        self._stance = StanceChoice(estimator, sensor, self._parameters, biped.weight)
        self.footing = None
        self._all_tasks.reset()
        self._stand = partial(
            Footing,
            biped=biped,
            dynamics=estimator.dynamics,
            anchors=estimator.anchors,
            omega=omega,
            region=region,
            sensor=sensor,
        )
