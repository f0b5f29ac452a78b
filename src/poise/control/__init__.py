"""The resolvers: from a state and a stack to a command."""

from poise.control.command import Command, CommandStatus
from poise.control.make import CONTROLLERS, make_controller
from poise.control.stack import Stack, default_stack
from poise.control.status import ControllerStatus, TaskStatus
from poise.control.whole_body import WholeBodyController

__all__ = [
    "CONTROLLERS",
    "Command",
    "CommandStatus",
    "ControllerStatus",
    "Stack",
    "TaskStatus",
    "WholeBodyController",
    "default_stack",
    "make_controller",
]
