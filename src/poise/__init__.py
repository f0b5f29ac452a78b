"""Poise: whole-body control for humanoid robots.

Tasks in strict priority in, joint torques out, with contacts and limits respected.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from poise import sim as sim
    from poise.apps.scenarios import load_scenario, report, run_scenario
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
    from poise.locomotion import StepTeleoperator, Walker
    from poise.robots import Robot, load_robot
    from poise.sim import Plant, Recorder, rollout
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

    __version__: str

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


_FACES = ("errors", "hqp", "robots", "dynamics", "stack", "control")
"""Packages of the core that have these names, from the ground up."""

_ABOVE = {
    "Plant": "poise.sim",
    "Recorder": "poise.sim",
    "StepTeleoperator": "poise.locomotion",
    "Walker": "poise.locomotion",
    "load_scenario": "poise.apps.scenarios",
    "report": "poise.apps.scenarios",
    "rollout": "poise.sim",
    "run_scenario": "poise.apps.scenarios",
}
"""Names of packages that take longer to import, or more to be installed, than the core."""


def __getattr__(name: str) -> Any:
    """Import what is used: the command's help needs neither Pinocchio nor compiled code."""
    if name == "__version__":
        return import_module("importlib.metadata").version("poise")
    if name in (*_FACES, "estimation", "hardware", "locomotion", "sim"):
        return import_module(f"poise.{name}")
    if name not in __all__:
        raise AttributeError(f"module 'poise' has no attribute {name!r}")
    faces = [_ABOVE[name]] if name in _ABOVE else [f"poise.{face}" for face in _FACES]
    return next(getattr(face, name) for face in map(import_module, faces) if hasattr(face, name))


def __dir__() -> list[str]:
    return __all__
