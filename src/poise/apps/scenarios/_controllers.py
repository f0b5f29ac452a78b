"""`Cast`: who takes part in a scenario beside the plant: controller, leader, what they need."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from poise.apps.scenarios._by_hand import NAME, DevicePlan
from poise.apps.scenarios._director import Director
from poise.apps.scenarios._scenario import Scenario
from poise.apps.teleoperation import SCRIPTS
from poise.control import (
    CONTROLLERS,
    Controller,
    ControllerKind,
    ControllerPlan,
    check_plan,
    make_controller,
    refuse_solver_settings,
)
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import StepTeleoperator, two_soles, walking_stack
from poise.robots import Robot
from poise.sim import Block, Estimator
from poise.stack import Leader

_STRATEGY = "com_shifter"
"""How a robot that is walked by hand keeps its balance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cast:
    """Who takes part in a scenario.

    Attributes:
        controller: gives the commands.
        leader: sets what it is asked for.
        estimator: says them where the robot is; nobody does when None.
        q_start: configuration at the start; the robot's home when None.
        blocks: on the floor, beside the scenario's own.
    """

    controller: Controller
    leader: Leader
    estimator: Estimator | None = None
    q_start: Float64[np.ndarray, " nq"] | None = None
    blocks: tuple[Block, ...] = ()


def is_by_hand(plan: ControllerPlan) -> bool:
    """Whether an operator walks the robot."""
    return plan.name == NAME


def controller_names() -> tuple[str, ...]:
    """What scenario files may call a controller."""
    return (*CONTROLLERS, NAME)


def strategy_of(plan: ControllerPlan) -> str:
    """How the controller of a checked plan solves."""
    if is_by_hand(plan):
        return _STRATEGY
    return plan.strategy or check_plan(plan).strategies[0]


def with_actuation(scenario: Scenario) -> Scenario:
    """The scenario on a plant that takes what its controller commands."""
    plan, plant = scenario.controller, scenario.plant
    _check_walk(scenario)
    if _check_by_hand(scenario):
        given = plant.actuation if scenario.actuation_given else "velocity"
        return replace(scenario, plant=replace(plant, actuation=given))
    actuation = _kind(plan).actuation
    if not scenario.actuation_given:
        return replace(scenario, plant=replace(plant, actuation=actuation))
    if plant.commanded != actuation:
        fitting = [n for n, k in CONTROLLERS.items() if k.actuation == plant.commanded]
        raise ConfigurationError(
            f"controller {plan.name!r} wants another actuation of the plant",
            got=plant.actuation,
            wanted=f"actuation {actuation}, or a controller that commands {plant.commanded}",
            choices=fitting,
        )
    return scenario


def cast_of(scenario: Scenario, robot: Robot) -> Cast:
    """Who takes part in a scenario that `with_actuation` has passed."""
    if scenario.devices is not None:
        return _by_hand(robot, scenario.devices, scenario)
    stack = scenario.stack.build() if scenario.stack is not None else None
    if stack is None and scenario.walks:
        stack = walking_stack(robot)
    plan = replace(scenario.controller, dt=scenario.plant.control_dt)
    controller = make_controller(robot, stack, plan)
    director = Director(scenario, controller.stack, robot)
    return Cast(controller=controller, leader=director)


def _by_hand(robot: Robot, devices: DevicePlan, scenario: Scenario) -> Cast:
    """An operator who leads the feet."""
    # Before a script is made for feet that are not there.
    two_soles(robot)
    dt = scenario.plant.control_dt
    script = SCRIPTS[devices.script](robot) if devices.script else None
    q_start = robot.q_home if script is None else script.posture(robot)
    teleoperator = StepTeleoperator(robot, q_start=q_start, actuation=scenario.plant.commanded)
    if dt != teleoperator.parameters.dt:
        raise ConfigurationError(
            f"controller {NAME} has another control period than the plant",
            got=f"plant: control_dt: {dt:g}",
            wanted=f"control_dt: {teleoperator.parameters.dt:g}",
        )
    teleoperator.device = devices.device(teleoperator, script, scenario.seed)
    return Cast(
        controller=teleoperator.controller(),
        leader=teleoperator,
        estimator=teleoperator.estimator,
        q_start=q_start,
        blocks=() if script is None else script.blocks,
    )


def _kind(plan: ControllerPlan) -> ControllerKind:
    if plan.name not in CONTROLLERS:
        raise UnknownNameError("no such controller", got=plan.name, choices=controller_names())
    return check_plan(plan)


def _check_walk(scenario: Scenario) -> None:
    """A walk is kept up by forces, which a controller that commands velocities does not know."""
    plan = scenario.controller
    if not scenario.walks:
        return
    if is_by_hand(plan) or _kind(plan).actuation != "torque":
        raise ConfigurationError(
            f"controller {plan.name!r} cannot follow the walk of scenario {scenario.name!r}",
            got=plan.name,
            choices=[n for n, k in CONTROLLERS.items() if k.actuation == "torque"],
        )


def _check_by_hand(scenario: Scenario) -> bool:
    """Whether an operator walks the robot, and then whether they can."""
    plan = scenario.controller
    if not is_by_hand(plan):
        _kind(plan)
        if scenario.devices is not None:
            raise ConfigurationError(
                f"controller {plan.name!r} does not heed the devices of scenario {scenario.name!r}",
                got=plan.name,
                wanted=f"controller {NAME}",
            )
        return False
    if scenario.devices is None:
        raise ConfigurationError(
            f"controller {NAME} needs devices, and scenario {scenario.name!r} has none",
            wanted="the section devices in the scenario's file",
        )
    if plan.strategy not in (None, _STRATEGY):
        raise UnknownNameError(
            f"no such strategy of controller {NAME}", got=plan.strategy, choices=(_STRATEGY,)
        )
    refuse_solver_settings(plan)
    given = {
        "stack": scenario.stack is not None,
        "motions": bool(scenario.motions),
        "contacts": bool(scenario.contact_changes),
    }
    for what in (name for name, there in given.items() if there):
        raise ConfigurationError(
            f"controller {NAME} takes no {what}: it follows the devices", wanted=f"no {what}"
        )
    return True
