"""Where the robot is and how fast, from what it can measure itself: inertial unit, encoders, soles.

`StateEstimator` is an estimator of `rollout`; its parts are of use alone.
"""

from poise.estimation._estimator import (
    ContactBelief as ContactBelief,
    EstimatorConfig,
    EstimatorStatus,
    StateEstimator,
)
from poise.estimation._filter import (
    ImuNoise as ImuNoise,
    InitialDeviation as InitialDeviation,
    InvariantFilter,
)
from poise.estimation._momentum import MomentumObserver

__all__ = [
    "EstimatorConfig",
    "EstimatorStatus",
    "InvariantFilter",
    "MomentumObserver",
    "StateEstimator",
]
