"""How the robot stands: its mode, its soles and legs, and where its feet can go."""

from poise.locomotion._stepping._stance._biped import KNEE, Biped, biped_of, leg_joints
from poise.locomotion._stepping._stance._desired import POSITION_GAIN, DesiredMotion
from poise.locomotion._stepping._stance._estimator import StanceEstimator, ZmpSensor
from poise.locomotion._stepping._stance._footing import (
    LANDED,
    Footing,
    StanceChoice,
    mean_angle,
    turn_to_left,
    wrapped,
    yaw_of,
)
from poise.locomotion._stepping._stance._lean import (
    LEVEL,
    TORSO_MOST,
    UPRIGHT,
    TrunkLean,
    TrunkPose,
)
from poise.locomotion._stepping._stance._parameters import TeleopParameters
from poise.locomotion._stepping._stance._reach import GIVES, FootRange
from poise.locomotion._stepping._stance._size import RobotSize

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
    "leg_joints",
    "mean_angle",
    "turn_to_left",
    "wrapped",
    "yaw_of",
]
