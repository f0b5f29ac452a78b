"""Stance of the robot: its mode, soles and legs, and the workspace of its feet."""

from poise.locomotion._stepping._stance._biped import (
    GIVES,
    KNEE,
    Biped,
    FootRange,
    biped_of,
    leg_joints,
)
from poise.locomotion._stepping._stance._estimator import StanceEstimator, ZmpSensor
from poise.locomotion._stepping._stance._footing import (
    LANDED,
    LEVEL,
    POSITION_GAIN,
    TORSO_MOST,
    UPRIGHT,
    DesiredMotion,
    Footing,
    StanceChoice,
    TrunkLean,
    TrunkPose,
)
from poise.locomotion._stepping._stance._parameters import (
    RobotSize,
    TeleopParameters,
    checked_actuation,
    checked_start,
    scaled_parameters,
    size_of,
    teleop_parameters,
)
from poise.locomotion._walking import mean_angle

__all__ = [
    "GIVES",
    "KNEE",
    "LANDED",
    "LEVEL",
    "POSITION_GAIN",
    "TORSO_MOST",
    "UPRIGHT",
    "Biped",
    "DesiredMotion",
    "FootRange",
    "Footing",
    "RobotSize",
    "StanceChoice",
    "StanceEstimator",
    "TeleopParameters",
    "TrunkLean",
    "TrunkPose",
    "ZmpSensor",
    "biped_of",
    "checked_actuation",
    "checked_start",
    "leg_joints",
    "mean_angle",
    "scaled_parameters",
    "size_of",
    "teleop_parameters",
]
