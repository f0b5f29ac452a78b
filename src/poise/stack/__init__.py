"""What the robot should do; each task gives rows and knows no solver."""

from poise.stack._axes import checked_gain, checked_target
from poise.stack._centroid import ComTask, MomentumTask
from poise.stack._contact import Contact
from poise.stack._contacts import PointContact, SurfaceContact
from poise.stack._frame import FrameTask
from poise.stack._joints import JointTask, PostureTask
from poise.stack._leader import Leader
from poise.stack._limits import JointLimit, TorqueLimit
from poise.stack._relative_frame import RelativeFrameTask
from poise.stack._rows import ContactSets, StackRows, home_jacobians
from poise.stack._stack import Stack, default_stack, is_held
from poise.stack._task import Task

__all__ = [
    "ComTask",
    "Contact",
    "ContactSets",
    "FrameTask",
    "JointLimit",
    "JointTask",
    "Leader",
    "MomentumTask",
    "PointContact",
    "PostureTask",
    "RelativeFrameTask",
    "Stack",
    "StackRows",
    "SurfaceContact",
    "Task",
    "TorqueLimit",
    "checked_gain",
    "checked_target",
    "default_stack",
    "home_jacobians",
    "is_held",
]
