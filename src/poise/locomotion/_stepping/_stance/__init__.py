"""How the robot stands: its mode, its soles and legs, and where its feet can go."""

from poise.locomotion._stepping._stance._biped import KNEE, Biped, biped_of, leg_joints
from poise.locomotion._stepping._stance._desired import DesiredMotion, StepTasks
from poise.locomotion._stepping._stance._estimator import StanceEstimator, ZmpSensor
from poise.locomotion._stepping._stance._footing import (
    Footing,
    StanceChoice,
    mean_angle,
    wrapped,
    yaw_of,
)
from poise.locomotion._stepping._stance._lean import TORSO_MOST, TrunkLean, TrunkPose
from poise.locomotion._stepping._stance._modes import (
    Mode,
    ModeEvent,
    ModeMachine,
    StepEnd,
    draw_modes,
)
from poise.locomotion._stepping._stance._one_foot import WIDE, OneFoot, inner_side, one_foot
from poise.locomotion._stepping._stance._parameters import TeleopParameters
from poise.locomotion._stepping._stance._reach import FootRange
from poise.locomotion._stepping._stance._tipping import SoleTipping

__all__ = [
    "KNEE",
    "TORSO_MOST",
    "WIDE",
    "Biped",
    "DesiredMotion",
    "FootRange",
    "Footing",
    "Mode",
    "ModeEvent",
    "ModeMachine",
    "OneFoot",
    "SoleTipping",
    "StanceChoice",
    "StanceEstimator",
    "StepEnd",
    "StepTasks",
    "TeleopParameters",
    "TrunkLean",
    "TrunkPose",
    "ZmpSensor",
    "biped_of",
    "draw_modes",
    "inner_side",
    "leg_joints",
    "mean_angle",
    "one_foot",
    "wrapped",
    "yaw_of",
]
