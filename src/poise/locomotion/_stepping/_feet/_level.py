"""`Level`: torques or velocities, to which a step teleoperator turns an operator's command."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

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
    """Command of a tick."""

    guard: OperatorGuard
    command: OperatorSample | None  # of the feet; None while they are lost
    body: BodyCommand
    torso: tuple[float, float, float]  # roll, pitch and yaw [rad]
    turns: tuple[float, float]  # yaw of the left and of the right foot [rad]
    upright: bool  # an upright torso comes first


class LevelTick(NamedTuple):
    """Outcome of a tick."""

    target: Float64[np.ndarray, "3"]  # of the swing foot [m]
    zmp_reference: Float64[np.ndarray, "2"]  # [m]
    cart_table_zmp: Float64[np.ndarray, "2"]  # (26) of the commanded acceleration [m]
    ended: StepEnd | None  # None while a step goes on, and before the first


class Level(ABC):
    """Leader of a stack that is solved for torques, or for velocities."""

    def __init__(
        self,
        biped: Biped,
        parameters: TeleopParameters,
        reach: FootRange,
        estimator: StanceEstimator,
        stack: Stack,
    ) -> None:
        self._biped, self._parameters, self._reach = biped, parameters, reach
        self._estimator, self.stack = estimator, stack
        self.footing: Footing | None = None  # of the last tick

    @abstractmethod
    def reset(self, sensor: ZmpSensor) -> None:
        """Stand on both feet as at the start."""

    @abstractmethod
    def controller(self, dynamics: Dynamics, time_limit: float | None) -> Controller:
        """Return the controller of the stack."""

    @property
    @abstractmethod
    def mode(self) -> Mode:
        """Feet that carry the robot."""

    @abstractmethod
    def outcome(self, footing: Footing) -> LevelTick:
        """Return the outcome of the last tick, before the next one begins."""

    @abstractmethod
    def lead(self, state: RobotState, operator: OperatorTick) -> bool:
        """Set the stack for a tick; return whether a walk by velocity has ended in it."""

    def _begin(self, sensor: ZmpSensor, omega: float, region: SingleSupportRegion) -> None:
        """Stand on both feet as at the start, over what stays the same of each `Footing`."""
        estimator, biped = self._estimator, self._biped
        self._stance = StanceChoice(estimator, sensor, biped, self._parameters.dt)
        self.footing = None
        self._stand = partial(
            Footing,
            biped=biped,
            estimator=estimator,
            omega=omega,
            region=region,
            sensor=sensor,
        )
