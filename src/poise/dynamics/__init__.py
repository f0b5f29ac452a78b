"""Dynamics of one state of a robot, computed once a tick."""

from poise.dynamics._dynamics import (
    LARGEST as LARGEST,
    CheckedWrenches as CheckedWrenches,
    Dynamics,
    FrameKinematics as FrameKinematics,
    RobotState,
    SensorReadings,
)
from poise.dynamics._motion import (
    BIAS as BIAS,
    KINEMATICS as KINEMATICS,
    ROTATION as ROTATION,
    VELOCITY as VELOCITY,
    Frames as Frames,
    Motion as Motion,
    StateNumbers as StateNumbers,
    column_at as column_at,
    frames_of as frames_of,
    momentum_rate as momentum_rate,
    motion_of as motion_of,
    place_frame as place_frame,
    turn_to_world as turn_to_world,
)
from poise.dynamics._partition import Partition as Partition, Partitions
from poise.dynamics._payload import LoadedModel as LoadedModel, PayloadEstimate
from poise.dynamics._reduction import (
    ReducedDynamics,
    ReducedMatrices as ReducedMatrices,
    from_coordinates as from_coordinates,
    reach_of as reach_of,
    reduce_dynamics as reduce_dynamics,
)
from poise.dynamics._trajectory import Quintic as Quintic, least_jerk
from poise.dynamics._vectors import (
    rotation_vector as rotation_vector,
    saturate as saturate,
    sine_between as sine_between,
    turn_between as turn_between,
)

__all__ = [
    "Dynamics",
    "Partitions",
    "PayloadEstimate",
    "ReducedDynamics",
    "RobotState",
    "SensorReadings",
    "least_jerk",
]
