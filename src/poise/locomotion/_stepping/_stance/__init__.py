"""How the robot stands: its mode, its soles and legs, and where its feet can go."""

from poise.locomotion._stepping._stance._biped import KNEE, Biped, biped_of, leg_joints
from poise.locomotion._stepping._stance._desired import DesiredMotion
from poise.locomotion._stepping._stance._estimator import StanceEstimator, ZmpSensor
from poise.locomotion._stepping._stance._footing import (
    Footing,
    StanceChoice,
    mean_angle,
    turn_to_left,
    wrapped,
    yaw_of,
)
from poise.locomotion._stepping._stance._lean import TORSO_MOST, TrunkLean, TrunkPose
from poise.locomotion._stepping._stance._parameters import TeleopParameters
from poise.locomotion._stepping._stance._reach import FootRange

__all__ = [
    "KNEE",
    "TORSO_MOST",
    "Biped",
    "DesiredMotion",
    "FootRange",
    "Footing",
    "StanceChoice",
    "StanceEstimator",
    "TeleopParameters",
    "TrunkLean",
    "TrunkPose",
    "ZmpSensor",
    "biped_of",
    "leg_joints",
    "mean_angle",
    "turn_to_left",
    "wrapped",
    "yaw_of",
]
