"""Everything about one state of a robot, computed once a tick."""

from poise.dynamics._chain_coordinates import (
    ChainFactors as ChainFactors,
    from_coordinates as from_coordinates,
    to_coordinates as to_coordinates,
)
from poise.dynamics._dynamics import Dynamics, FrameKinematics as FrameKinematics, RobotState
from poise.dynamics._partition import (
    FreeChain as FreeChain,
    Partition as Partition,
    Partitions,
    Selection as Selection,
)
from poise.dynamics._reduction import ReducedDynamics
from poise.dynamics._trajectory import Quintic as Quintic, least_jerk
from poise.dynamics._vectors import (
    rotation_sine as rotation_sine,
    rotation_vector as rotation_vector,
    saturate as saturate,
)

__all__ = [
    "Dynamics",
    "Partitions",
    "ReducedDynamics",
    "RobotState",
    "least_jerk",
]
