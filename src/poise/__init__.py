"""Poise: whole-body control for humanoid robots.

Tasks in strict priority in, joint torques out, with contacts and limits respected.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from poise.contacts import Contact, PointContact, SurfaceContact
from poise.control import (
    Command,
    CommandStatus,
    ControllerStatus,
    DifferentialIK,
    OperationalSpaceController,
    ReducedController,
    Stack,
    WholeBodyController,
    default_stack,
)
from poise.dynamics import Dynamics, RobotState
from poise.errors import PoiseError
from poise.hqp import HierarchicalProblem, Level, Solution, solve
from poise.limits import JointLimit, TorqueLimit
from poise.robots import Robot, load_robot
from poise.tasks import (
    ComTask,
    FrameTask,
    JointTask,
    MomentumTask,
    PostureTask,
    RelativeFrameTask,
    Task,
)

if TYPE_CHECKING:
    from poise import scenarios, sim

__version__ = "0.1.0"

__all__ = [
    "ComTask",
    "Command",
    "CommandStatus",
    "Contact",
    "ControllerStatus",
    "DifferentialIK",
    "Dynamics",
    "FrameTask",
    "HierarchicalProblem",
    "JointLimit",
    "JointTask",
    "Level",
    "MomentumTask",
    "OperationalSpaceController",
    "PointContact",
    "PoiseError",
    "PostureTask",
    "ReducedController",
    "RelativeFrameTask",
    "Robot",
    "RobotState",
    "Solution",
    "Stack",
    "SurfaceContact",
    "Task",
    "TorqueLimit",
    "WholeBodyController",
    "default_stack",
    "load_robot",
    "scenarios",
    "sim",
    "solve",
]


def __getattr__(name: str) -> Any:
    """The simulator's side is imported when first asked for: the core runs without it."""
    if name in ("sim", "scenarios"):
        return import_module(f"poise.{name}")
    raise AttributeError(f"module 'poise' has no attribute {name!r}")
