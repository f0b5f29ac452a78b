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
    """Which controller, and how it solves.

    Attributes:
        name: one of `CONTROLLERS`.
        strategy: how it solves, one of the controller's own strategies; its default when None.
        backend: QP solver of the cascade and weighted strategies.
        time_limit: cap of one solve of a controller by quadratic programs [s], None for none.
        dt: control period, which a controller that commands velocities has to know [s]; a scenario
            puts its plant's in.
    """

    name: AnyText = "whole_body"
    strategy: Text | None = None
    backend: Text | None = None
    time_limit: Duration | None = None
    dt: Duration = field(default=1e-3, metadata=NOT_IN_FILES)


@dataclass(frozen=True, kw_only=True)
class ControllerKind:
    """One kind of controller.

    Attributes:
        strategies: how it can solve, the default first.
        make: makes one, with the strategy filled in.
        actuation: what it commands, and what a plant must take.
        solver_settings: whether it takes `backend` and `time_limit` of a plan.
    """

    strategies: tuple[str, ...]
    make: Callable[[Robot, Stack | None, ControllerPlan, str, Dynamics | None], Controller]
    actuation: Literal["torque", "velocity"] = "torque"
    solver_settings: bool = False


def _by_programs(
    controller: type[WholeBodyController] | type[ReducedController],
) -> Callable[[Robot, Stack | None, ControllerPlan, str, Dynamics | None], Controller]:
    """Makes controllers that solve quadratic programs."""

    def make(
        robot: Robot,
        stack: Stack | None,
        plan: ControllerPlan,
        strategy: str,
        dynamics: Dynamics | None,
    ) -> Controller:
        return controller(
            robot,
            stack,
            strategy=strategy,
            backend=plan.backend,
            time_limit=plan.time_limit,
            dynamics=dynamics,
        )

    return make


def _osf(
    robot: Robot, stack: Stack | None, _plan: ControllerPlan, _: str, dynamics: Dynamics | None
) -> Controller:
    return OperationalSpaceController(robot, stack, dynamics=dynamics)


def _differential_ik(
    robot: Robot,
    stack: Stack | None,
    plan: ControllerPlan,
    strategy: str,
    dynamics: Dynamics | None,
) -> Controller:
    return DifferentialIK(robot, stack, dt=plan.dt, strategy=strategy, dynamics=dynamics)


CONTROLLERS: Mapping[str, ControllerKind] = {
    "whole_body": ControllerKind(
        strategies=STRATEGIES, make=_by_programs(WholeBodyController), solver_settings=True
    ),
    "reduced": ControllerKind(
        strategies=STRATEGIES, make=_by_programs(ReducedController), solver_settings=True
    ),
    "osf": ControllerKind(strategies=("fused",), make=_osf),
    "differential_ik": ControllerKind(
        strategies=IK_STRATEGIES, make=_differential_ik, actuation="velocity"
    ),
}
"""Controllers by name."""


def check_plan(plan: ControllerPlan) -> ControllerKind:
    """The kind of controller that a plan names."""
    if plan.name not in CONTROLLERS:
        raise UnknownNameError("no such controller", got=plan.name, choices=CONTROLLERS)
    kind = CONTROLLERS[plan.name]
    if plan.strategy is not None and plan.strategy not in kind.strategies:
        raise UnknownNameError(
            f"no such strategy of controller {plan.name}",
            got=plan.strategy,
            choices=kind.strategies,
        )
    if not kind.solver_settings:
        refuse_solver_settings(plan)
    return kind


def refuse_solver_settings(plan: ControllerPlan) -> None:
    """Refuses what only controllers take that leave their solver to the user."""
    for value, what in ((plan.backend, "backend"), (plan.time_limit, "time_limit")):
        if value is not None:
            raise ConfigurationError(
                f"controller {plan.name} takes no {what}",
                got=value,
                wanted=f"no {what}, or a controller that takes one",
                choices=[name for name, kind in CONTROLLERS.items() if kind.solver_settings],
            )


def make_controller(
    robot: Robot,
    stack: Stack | None = None,
    plan: ControllerPlan | None = None,
    *,
    dynamics: Dynamics | None = None,
) -> Controller:
    """A controller by name.

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
    return kind.make(robot, stack, plan, plan.strategy or kind.strategies[0], dynamics)
