"""Poise: whole-body control for humanoid robots.

Tasks in strict priority in, joint torques out, with contacts and limits respected.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from poise.control import (
    Command,
    CommandStatus,
    Controller,
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
    BalanceLimit,
    ComTask,
    Contact,
    FrameTask,
    JointLimit,
    JointTask,
    Leader,
    MomentumTask,
    PointContact,
    PostureTask,
    RelativeFrameTask,
    SelfCollisionLimit,
    Stack,
    SurfaceContact,
    Task,
    TorqueLimit,
    default_stack,
)

if TYPE_CHECKING:
    from poise import sim as sim
    from poise.apps.scenarios import load_scenario, report, run_scenario
    from poise.locomotion import StepTeleoperator, Walker
    from poise.sim import Plant, Recorder, rollout

__version__ = "0.1.0"

__all__ = [
    "BalanceLimit",
    "ComTask",
    "Command",
    "CommandStatus",
    "Contact",
    "Controller",
    "DifferentialIK",
    "Dynamics",
    "FrameTask",
    "HierarchicalProblem",
    "JointLimit",
    "JointTask",
    "Leader",
    "Level",
    "MomentumTask",
    "OperationalSpaceController",
    "Plant",
    "PointContact",
    "PoiseError",
    "PostureTask",
    "Recorder",
    "ReducedController",
    "RelativeFrameTask",
    "Robot",
    "RobotState",
    "SelfCollisionLimit",
    "Solution",
    "Stack",
    "StepTeleoperator",
    "SurfaceContact",
    "Task",
    "TorqueLimit",
    "Walker",
    "WholeBodyController",
    "default_stack",
    "load_robot",
    "load_scenario",
    "report",
    "rollout",
    "run_scenario",
    "solve",
]


_LATER = {
    "Plant": "poise.sim",
    "Recorder": "poise.sim",
    "StepTeleoperator": "poise.locomotion",
    "Walker": "poise.locomotion",
    "load_scenario": "poise.apps.scenarios",
    "report": "poise.apps.scenarios",
    "rollout": "poise.sim",
    "run_scenario": "poise.apps.scenarios",
}
"""Names whose packages take longer to import, or more to be installed, than the core."""


def __getattr__(name: str) -> Any:
    """What is more than the core is imported when first asked for: the core runs without it."""
    if name == "sim":
        return import_module("poise.sim")
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    raise AttributeError(f"module 'poise' has no attribute {name!r}")
