"""The resolvers: from a state and a stack to a command."""

from poise.control.command import Command, CommandStatus
from poise.control.controller import Controller
from poise.control.differential_ik import DifferentialIK
from poise.control.make import CONTROLLERS, ControllerPlan, make_controller
from poise.control.osf import OperationalSpaceController, RankTreatment
from poise.control.reduced import ReducedController
from poise.control.stack import Stack, default_stack
from poise.control.status import ControllerStatus, TaskStatus
from poise.control.whole_body import WholeBodyController

__all__ = [
    "CONTROLLERS",
    "Command",
    "CommandStatus",
    "Controller",
    "ControllerPlan",
    "ControllerStatus",
    "DifferentialIK",
    "OperationalSpaceController",
    "RankTreatment",
    "ReducedController",
    "Stack",
    "TaskStatus",
    "WholeBodyController",
    "default_stack",
    "make_controller",
]
