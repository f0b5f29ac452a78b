"""Everything about one state of a robot, computed once a tick."""

from poise.dynamics._chain_coordinates import ChainFactors, from_coordinates, to_coordinates
from poise.dynamics._dynamics import Dynamics, FrameKinematics, RobotState
from poise.dynamics._partition import FreeChain, Partition, Partitions, Selection
from poise.dynamics._reduction import ReducedDynamics
from poise.dynamics._trajectory import Quintic, least_jerk
from poise.dynamics._vectors import rotation_sine, rotation_vector, saturate

__all__ = [
    "ChainFactors",
    "Dynamics",
    "FrameKinematics",
    "FreeChain",
    "Partition",
    "Partitions",
    "Quintic",
    "ReducedDynamics",
    "RobotState",
    "Selection",
    "from_coordinates",
    "least_jerk",
    "rotation_sine",
    "rotation_vector",
    "saturate",
    "to_coordinates",
]
