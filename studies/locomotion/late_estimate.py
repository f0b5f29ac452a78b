"""`LateEstimate`: what studies control by, an estimate carried on over the sensors' delay."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from poise.dynamics import RobotState
from poise.estimation import PayloadEstimator, StateEstimator, StatePredictor
from poise.robots import Robot
from poise.sim import SensorConfig

PERIOD = 0.002
"""Of the controller [s]."""

DELAY = 0.002
"""Of all sensors [s]."""


def typical_sensors() -> SensorConfig:
    """Sensors with the errors of a real robot's, late."""
    return replace(SensorConfig.typical(), delay=DELAY)


class LateEstimate:
    """The estimator, looking for what the robot carries, with a predictor behind it."""

    def __init__(
        self,
        robot: Robot,
        *,
        q_start: Float64[np.ndarray, " nq"] | None = None,  # home when None
    ) -> None:
        payload = PayloadEstimator(robot)
        self._estimator = StateEstimator(robot, q_start=q_start, payload=payload)
        self._predictor = StatePredictor(robot, DELAY, PERIOD)

    def update(self, state: RobotState) -> RobotState:
        """The state of now."""
        return self._predictor.predict(self._estimator.update(state))

    def command(self, acceleration: Float64[np.ndarray, " nv"] | None, time: float) -> None:
        """Takes in what the robot was commanded."""
        del time  # The delay is known; nobody has to look at stamps.
        self._predictor.command(acceleration)
