"""Controllers: compute a command from a state and a stack, by a chosen strategy."""

from poise.control._command import (
    Command,
    Commands as Commands,
    CommandStatus,
    ControllerStatus as ControllerStatus,
    TaskStatus as TaskStatus,
)
from poise.control._controller import Controller
from poise.control._differential_ik import DifferentialIK
from poise.control._fallback import fault_of as fault_of, is_usable as is_usable
from poise.control._make import (
    CONTROLLERS,
    ControllerKind as ControllerKind,
    ControllerPlan,
    check_plan as check_plan,
    make_controller,
    refuse_solver_settings as refuse_solver_settings,
)
from poise.control._osf import OperationalSpaceController
from poise.control._rank import RankTreatment
from poise.control._reduced import ReducedController
from poise.control._strategy import (
    PHYSICS_LEVELS as PHYSICS_LEVELS,
    PHYSICS_TOLERANCE as PHYSICS_TOLERANCE,
)
from poise.control._warm_up import usable_cores as usable_cores, warm_up as warm_up
from poise.control._whole_body import WholeBodyController

__all__ = [
    "CONTROLLERS",
    "Command",
    "CommandStatus",
    "Controller",
    "ControllerPlan",
    "DifferentialIK",
    "OperationalSpaceController",
    "RankTreatment",
    "ReducedController",
    "WholeBodyController",
    "make_controller",
]
