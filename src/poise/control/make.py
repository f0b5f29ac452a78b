"""Controllers by name, as scenario files and the command line choose them."""

from dataclasses import dataclass

from poise.control.stack import Stack
from poise.control.whole_body import WholeBodyController
from poise.errors import UnknownNameError
from poise.robots.robot import Robot

CONTROLLERS = {"whole_body": WholeBodyController}
"""Controllers by name."""


@dataclass(frozen=True, kw_only=True)
class ControllerPlan:
    """Which controller, and how it solves.

    Attributes:
        name: one of `CONTROLLERS`.
        strategy: "direct", "cascade" or "weighted".
        backend: QP solver of the cascade and weighted strategies.
        time_limit: cap of one solve [s], None for none.
    """

    name: str = "whole_body"
    strategy: str = "direct"
    backend: str | None = None
    time_limit: float | None = None


def make_controller(
    robot: Robot, stack: Stack | None = None, plan: ControllerPlan | None = None
) -> WholeBodyController:
    """A controller by name.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks; the robot's default stack when None.
        plan: which controller; the defaults of `ControllerPlan` when None.

    Raises:
        UnknownNameError: no such controller, strategy or backend.
        PoiseError: the stack does not fit the robot.
    """
    plan = plan or ControllerPlan()
    if plan.name not in CONTROLLERS:
        raise UnknownNameError("no such controller", got=plan.name, choices=CONTROLLERS)
    return CONTROLLERS[plan.name](
        robot,
        stack,
        strategy=plan.strategy,
        backend=plan.backend,
        time_limit=plan.time_limit,
    )
