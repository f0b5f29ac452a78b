"""Stance of the robot: its mode, soles and legs, and the workspace of its feet."""

from poise.locomotion._stepping._stance._estimator import (
    LANDED as LANDED,
    POSITION_GAIN as POSITION_GAIN,
    StanceEstimator as StanceEstimator,
)
from poise.locomotion._stepping._stance._footing import (
    LEVEL as LEVEL,
    TORSO_MOST as TORSO_MOST,
    UPRIGHT as UPRIGHT,
    Footing as Footing,
    TrunkPose as TrunkPose,
)
from poise.locomotion._stepping._stance._parameters import (
    BASE_JOINT as BASE_JOINT,
    Biped as Biped,
    TeleopParameters as TeleopParameters,
    biped_of as biped_of,
    checked_actuation as checked_actuation,
    checked_start as checked_start,
    scaled_parameters as scaled_parameters,
    teleop_parameters as teleop_parameters,
)
