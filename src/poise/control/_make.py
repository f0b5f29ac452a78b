"""Controllers by name, as scenario files and the command line choose them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from poise._schema import NOT_IN_FILES, AnyText, Duration, Text, checked
from poise.control._controller import Controller
from poise.control._differential_ik import STRATEGIES as IK_STRATEGIES, DifferentialIK
from poise.control._osf import OperationalSpaceController
from poise.control._reduced import ReducedController
from poise.control._whole_body import WholeBodyController
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError, UnknownNameError
from poise.hqp import STRATEGIES
from poise.robots import Robot
from poise.stack import Stack


@checked()
@dataclass(frozen=True, kw_only=True)
class ControllerPlan:
    """A controller and its settings.

    Attributes:
        name: one of `CONTROLLERS`.
        strategy: one of the controller's own strategies; its default when None.
        backend: QP solver of the cascade and weighted strategies.
        time_limit: cap of one solve of a controller by quadratic programs [s], None for none.
        dt: control period of a controller that commands velocities [s]; that of the plant in a
            scenario.
    """

    name: AnyText = "whole_body"
    strategy: Text | None = None
    backend: Text | None = None
    time_limit: Duration | None = None
    dt: Duration = field(default=1e-3, metadata=NOT_IN_FILES)


@dataclass(frozen=True, kw_only=True)
class ControllerKind:
    """One kind of controller."""

    controller: Callable[..., Controller]
    strategies: tuple[str, ...]  # the default first
    settings: tuple[str, ...]  # fields of a plan that are arguments of the controller
    actuation: Literal["torque", "velocity"] = "torque"


_BY_PROGRAMS = ("strategy", "backend", "time_limit")

CONTROLLERS: Mapping[str, ControllerKind] = {
    "whole_body": ControllerKind(
        controller=WholeBodyController, strategies=STRATEGIES, settings=_BY_PROGRAMS
    ),
    "reduced": ControllerKind(
        controller=ReducedController, strategies=STRATEGIES, settings=_BY_PROGRAMS
    ),
    "osf": ControllerKind(
        controller=OperationalSpaceController, strategies=("fused",), settings=()
    ),
    "differential_ik": ControllerKind(
        controller=DifferentialIK,
        strategies=IK_STRATEGIES,
        settings=("strategy", "dt"),
        actuation="velocity",
    ),
}
"""Controllers by name."""


def check_plan(plan: ControllerPlan) -> ControllerKind:
    """Return the kind of controller that a plan names, with the plan checked."""
    if plan.name not in CONTROLLERS:
        raise UnknownNameError("no such controller", got=plan.name, choices=CONTROLLERS)
    kind = CONTROLLERS[plan.name]
    if plan.strategy is not None and plan.strategy not in kind.strategies:
        raise UnknownNameError(
            f"no such strategy of controller {plan.name}",
            got=plan.strategy,
            choices=kind.strategies,
        )
    if "time_limit" not in kind.settings:
        refuse_solver_settings(plan)
    return kind


def refuse_solver_settings(plan: ControllerPlan) -> None:
    """Refuse settings of a solver that only controllers by quadratic programs take."""
    for value, what in ((plan.backend, "backend"), (plan.time_limit, "time_limit")):
        if value is not None:
            raise ConfigurationError(
                f"controller {plan.name} takes no {what}",
                got=value,
                wanted=f"no {what}, or a controller that takes one",
                choices=[name for name, kind in CONTROLLERS.items() if what in kind.settings],
            )


def make_controller(
    robot: Robot,
    stack: Stack | None = None,
    plan: ControllerPlan | None = None,
    *,
    dynamics: Dynamics | None = None,
) -> Controller:
    """Make a controller by name.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks; the robot's default stack when None.
        plan: which controller; the defaults of `ControllerPlan` when None.
        dynamics: shared with the estimator of the state, see `Controller`; its own when None.

    Raises:
        UnknownNameError: no such controller, strategy or backend.
        PoiseError: the stack does not fit the robot, or the controller does not take a setting.
    """
    plan = plan or ControllerPlan()
    kind = check_plan(plan)
    settings = {name: getattr(plan, name) for name in kind.settings}
    if "strategy" in settings:
        settings["strategy"] = plan.strategy or kind.strategies[0]
    return kind.controller(robot, stack, dynamics=dynamics, **settings)
