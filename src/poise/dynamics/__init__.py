"""Everything about one state of a robot, computed once a tick."""

from poise.dynamics.dynamics import Dynamics
from poise.dynamics.frames import FrameKinematics
from poise.dynamics.partition import HangingChain, Partition, Partitions
from poise.dynamics.rates import MatrixRates
from poise.dynamics.reduction import ReducedDynamics
from poise.dynamics.rotations import rotation_sine, rotation_vector
from poise.dynamics.selection import Selection
from poise.dynamics.state import RobotState

__all__ = [
    "Dynamics",
    "FrameKinematics",
    "HangingChain",
    "MatrixRates",
    "Partition",
    "Partitions",
    "ReducedDynamics",
    "RobotState",
    "Selection",
    "rotation_sine",
    "rotation_vector",
]
