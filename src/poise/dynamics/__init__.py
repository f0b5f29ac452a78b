"""Everything about one state of a robot, computed once a tick."""

from poise.dynamics.dynamics import Dynamics
from poise.dynamics.frames import FrameKinematics
from poise.dynamics.rotations import rotation_vector
from poise.dynamics.state import RobotState

__all__ = ["Dynamics", "FrameKinematics", "RobotState", "rotation_vector"]
