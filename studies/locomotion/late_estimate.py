"""`LateEstimate`: what studies control by, an estimate carried on over the sensors' delay."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from poise.dynamics import RobotState
from poise.estimation import EstimatorConfig, PayloadEstimator, StateEstimator, StatePredictor
from poise.robots import Robot
from poise.sim import SensorConfig

PERIOD = 0.002
"""Of the controller [s]."""

DELAY = 0.002
"""Of all sensors [s]."""


def typical_sensors(delay: float = DELAY) -> SensorConfig:
    """Sensors with the errors of a real robot's, late.

    Args:
        delay: of all of them [s].
    """
    return replace(SensorConfig.typical(), delay=delay)


class LateEstimate:
    """The estimator, looking for what the robot carries, with a predictor behind it.

    What `poise run` and `poise drive` have, as a rollout asks them.
    """

    def __init__(
        self,
        robot: Robot,  # the robot
        config: EstimatorConfig | None = None,  # of the estimator; its defaults when None
        *,
        q_start: Float64[np.ndarray, " nq"] | None = None,  # where the robot begins; home when None
        delay: float = DELAY,  # of the sensors [s]
        # Changes what is measured; nothing does when None
        fault: Callable[[RobotState], RobotState] | None = None,
    ) -> None:
        self._fault = fault
        payload = PayloadEstimator(robot)
        self._estimator = StateEstimator(robot, config, q_start=q_start, payload=payload)
        self._predictor = StatePredictor(robot, delay, PERIOD)

    def update(self, state: RobotState) -> RobotState:
        """The state of now."""
        measured = state if self._fault is None else self._fault(state)
        return self._predictor.predict(self._estimator.update(measured))

    def command(self, acceleration: Float64[np.ndarray, " nv"] | None, time: float) -> None:
        """Takes in what the robot was commanded."""
        del time  # The delay is known; nobody has to look at stamps.
        self._predictor.command(acceleration)
