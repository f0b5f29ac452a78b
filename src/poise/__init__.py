"""Poise: whole-body control for humanoid robots.

Tasks in strict priority in, joint torques out, with contacts and limits respected.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from poise.control import (
    Command,
    CommandStatus,
    ControllerStatus,
    DifferentialIK,
    OperationalSpaceController,
    ReducedController,
    WholeBodyController,
)
from poise.dynamics import Dynamics, RobotState
from poise.errors import PoiseError
from poise.hqp import HierarchicalProblem, Level, Solution, solve
from poise.robots import Robot, load_robot
from poise.stack import (
    ComTask,
    Contact,
    FrameTask,
    JointLimit,
    JointTask,
    MomentumTask,
    PointContact,
    PostureTask,
    RelativeFrameTask,
    Stack,
    SurfaceContact,
    Task,
    TorqueLimit,
    default_stack,
)

if TYPE_CHECKING:
    from poise import sim
    from poise.apps import scenarios

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


_LATER = {"sim": "poise.sim", "scenarios": "poise.apps.scenarios"}
"""Packages by the name that they have here, which take more than the core needs."""


def __getattr__(name: str) -> Any:
    """The simulator's side is imported when first asked for: the core runs without it."""
    if name in _LATER:
        return import_module(_LATER[name])
    raise AttributeError(f"module 'poise' has no attribute {name!r}")
