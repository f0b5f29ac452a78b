"""State of the robot from inertial unit, encoders and load cells of the soles.

`StateEstimator` is an estimator of `rollout`; its parts are of use alone. `StatePredictor` and
`StampedPredictor` make up for sensors that are late.
"""

from poise.estimation._attitude_bias import (
    AttitudeBiasEstimator as AttitudeBiasEstimator,
)
from poise.estimation._cell_vote import LoadCellVote as LoadCellVote
from poise.estimation._config import (
    AttitudeBiasBelief as AttitudeBiasBelief,
    ContactBelief as ContactBelief,
    EstimatorConfig,
    ImuNoise as ImuNoise,
    InitialDeviation as InitialDeviation,
    PayloadBelief as PayloadBelief,
)
from poise.estimation._estimator import EstimatorStatus, StateEstimator
from poise.estimation._filter import InvariantFilter
from poise.estimation._load_cells import LoadCellTare as LoadCellTare
from poise.estimation._momentum import MomentumObserver
from poise.estimation._payload import PayloadEstimator
from poise.estimation._prediction import StampedPredictor as StampedPredictor, StatePredictor

__all__ = [
    "EstimatorConfig",
    "EstimatorStatus",
    "InvariantFilter",
    "MomentumObserver",
    "PayloadEstimator",
    "StateEstimator",
    "StatePredictor",
]
