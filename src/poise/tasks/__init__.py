"""What the robot should do; each task gives rows and knows no solver."""

from poise.tasks.com import ComTask
from poise.tasks.frame import FrameTask
from poise.tasks.joint import JointTask, PostureTask
from poise.tasks.momentum import MomentumTask
from poise.tasks.relative_frame import RelativeFrameTask
from poise.tasks.task import Task

__all__ = [
    "ComTask",
    "FrameTask",
    "JointTask",
    "MomentumTask",
    "PostureTask",
    "RelativeFrameTask",
    "Task",
]
