"""State of the robot from inertial unit, encoders and load cells of the soles."""

from poise.estimation._config import (
    ContactBelief as ContactBelief,
    EstimatorConfig,
    ImuNoise as ImuNoise,
    InitialDeviation as InitialDeviation,
    PayloadBelief as PayloadBelief,
)
from poise.estimation._estimator import StateEstimator
from poise.estimation._filter import InvariantFilter
from poise.estimation._load_cells import LoadCellTare as LoadCellTare, LoadCellVote as LoadCellVote
from poise.estimation._momentum import MomentumObserver
from poise.estimation._payload import PayloadEstimator
from poise.estimation._prediction import StampedPredictor as StampedPredictor, StatePredictor
from poise.estimation._tick import EstimatorStatus

__all__ = [
    "EstimatorConfig",
    "EstimatorStatus",
    "InvariantFilter",
    "MomentumObserver",
    "PayloadEstimator",
    "StateEstimator",
    "StatePredictor",
]
