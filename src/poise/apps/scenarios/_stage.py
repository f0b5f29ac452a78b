"""`stage_scenario`: a scenario on its robot, ready for a rollout."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from jaxtyping import Float64

from poise.apps.scenarios._checks import validate_checks
from poise.apps.scenarios._director import Director
from poise.apps.scenarios._scenario import DevicePlan, Scenario
from poise.apps.scenarios._size import size_ratio, sized, sized_checks, without_hands
from poise.apps.teleoperation import (
    SCRIPTS,
    BadOperator,
    PoorLink,
    Script,
    read_recording,
    terrain_blocks,
)
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
from poise.estimation import PayloadEstimator, StateEstimator
from poise.locomotion import Device, ScriptedDevice, StepTeleoperator, two_soles, walking_stack
from poise.robots import Robot, load_robot
from poise.sim import Estimator, Plant, Push
from poise.stack import Leader

_BY_HAND, _STRATEGY = "step_teleoperation", "com_shifter"
"""Controller of a robot that an operator walks, in scenario files, and its usual strategy: others
are names of controllers that solve its stack."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """Everything that `rollout` needs for a scenario, before its first tick."""

    scenario: Scenario  # scaled to the robot, with actuation and blocks of its controller
    robot: Robot
    plant: Plant  # pushes included
    controller: Controller
    leader: Leader
    estimator: Estimator | None  # None where controller and leader have the plant's own state
    pushes: tuple[Push, ...]


def controller_names() -> tuple[str, ...]:
    """Names of controllers in scenario files."""
    return (*CONTROLLERS, _BY_HAND)


def stage_scenario(scenario: Scenario, robot: Robot | None = None) -> Stage:
    """Set up a scenario: everything but the rollout and its observers.

    Args:
        scenario: the scenario.
        robot: the robot; the scenario's own when None.

    Raises:
        PoiseError: the scenario does not fit its robot.
    """
    scenario = _with_actuation(scenario)
    robot = load_robot(scenario.robot) if robot is None else robot
    ratio = size_ratio(scenario, robot)
    scenario = without_hands(sized(scenario, ratio), robot)
    _check_limbs(scenario, robot)
    scenario = _with_terrain(scenario, robot)
    q_start, estimator = None, None
    if scenario.devices is not None:
        scenario, leader, q_start = _by_hand(scenario, scenario.devices, robot)
        controller, estimator = leader.controller(), leader.estimator
    else:
        stack = scenario.stack.build() if scenario.stack is not None else None
        if stack is None and scenario.walks:
            stack = walking_stack(robot)
        plan = replace(scenario.controller, dt=scenario.plant.control_dt)
        controller = make_controller(robot, stack, plan)
        leader = Director(scenario, controller.stack, robot)
        if robot.floating_base and not scenario.ground_truth:
            estimator = StateEstimator(robot, payload=PayloadEstimator(robot))
    validate_checks(scenario.checks, leader.stack, robot)
    checks = sized_checks(scenario.checks, leader.stack, ratio)
    scenario = replace(scenario, checks=checks)
    plant = Plant(robot, scenario.plant, seed=scenario.seed)
    plant.reset(q_start)
    pushes = tuple(
        plant.push(push.body, push.force_on(robot.mass), push.duration, push.at)
        for push in scenario.pushes
    )
    return Stage(
        scenario=scenario,
        robot=robot,
        plant=plant,
        controller=controller,
        leader=leader,
        estimator=estimator,
        pushes=pushes,
    )


def _with_terrain(scenario: Scenario, robot: Robot) -> Scenario:
    """The scenario with the blocks of its terrain."""
    if scenario.terrain == "flat":
        return scenario
    blocks = terrain_blocks(scenario.terrain, robot, seed=scenario.seed)
    plant, unknown = scenario.plant, tuple(replace(block, told=False) for block in blocks)
    return replace(scenario, plant=replace(plant, blocks=plant.blocks + unknown))


def _by_hand(
    scenario: Scenario, devices: DevicePlan, robot: Robot
) -> tuple[Scenario, StepTeleoperator, Float64[np.ndarray, " nq"]]:
    """The scenario with the blocks of its script, the leader of the feet, and where it begins."""
    # Before a script is made for feet that are not there.
    two_soles(robot)
    script = SCRIPTS[devices.script](robot) if devices.script else None
    q_start = robot.q_home if script is None else script.posture(robot)
    plant = scenario.plant
    solver = scenario.controller.strategy
    teleoperator = StepTeleoperator(
        robot,
        q_start=q_start,
        actuation=plant.commanded,
        solved_by=None if solver == _STRATEGY else solver,
    )
    if plant.control_dt != teleoperator.parameters.dt:
        raise ConfigurationError(
            f"controller {_BY_HAND} has another control period than the plant",
            got=f"plant: control_dt: {plant.control_dt:g}",
            wanted=f"control_dt: {teleoperator.parameters.dt:g}",
        )
    teleoperator.device = _device(devices, teleoperator, script, scenario.seed)
    if script is not None:
        scenario = replace(scenario, plant=replace(plant, blocks=plant.blocks + script.blocks))
    return scenario, teleoperator, q_start


def _device(
    plan: DevicePlan, teleoperator: StepTeleoperator, script: Script | None, seed: int
) -> Device:
    if plan.recording:
        device: Device = read_recording(plan.recording).device(teleoperator)
    elif plan.bad_operator:
        device = BadOperator(teleoperator, seed)
    else:
        points = plan.points if script is None else script.points
        device = ScriptedDevice(points, *teleoperator.estimator.anchors)
    if plan.latency or plan.loss or plan.cut is not None:
        device = PoorLink(device, latency=plan.latency, loss=plan.loss, cut=plan.cut, seed=seed)
    return device


def _kind(plan: ControllerPlan) -> ControllerKind:
    if plan.name not in CONTROLLERS:
        raise UnknownNameError("no such controller", got=plan.name, choices=controller_names())
    return check_plan(plan)


def _with_actuation(scenario: Scenario) -> Scenario:
    """The scenario on a plant that takes the commands of its controller."""
    plan, plant = scenario.controller, scenario.plant
    by_hand = plan.name == _BY_HAND
    actuation = "velocity" if by_hand else _kind(plan).actuation
    # A walk needs contact forces, which controllers that command velocities do not compute.
    if scenario.walks and actuation != "torque":
        raise ConfigurationError(
            f"controller {plan.name!r} cannot follow the walk of scenario {scenario.name!r}",
            got=plan.name,
            choices=[n for n, k in CONTROLLERS.items() if k.actuation == "torque"],
        )
    if by_hand:
        _check_by_hand(scenario)
    elif scenario.devices is not None:
        raise ConfigurationError(
            f"controller {plan.name!r} does not heed the devices of scenario {scenario.name!r}",
            got=plan.name,
            wanted=f"controller {_BY_HAND}",
        )
    if not scenario.actuation_given:
        return replace(scenario, plant=replace(plant, actuation=actuation))
    if not by_hand and plant.commanded != actuation:
        fitting = [n for n, k in CONTROLLERS.items() if k.actuation == plant.commanded]
        raise ConfigurationError(
            f"controller {plan.name!r} wants another actuation of the plant",
            got=plant.actuation,
            wanted=f"actuation {actuation}, or a controller that commands {plant.commanded}",
            choices=fitting,
        )
    return scenario


def _check_by_hand(scenario: Scenario) -> None:
    """Reject settings that step teleoperation does not use."""
    plan = scenario.controller
    if scenario.devices is None:
        raise ConfigurationError(
            f"controller {_BY_HAND} needs devices, and scenario {scenario.name!r} has none",
            wanted="the section devices in the scenario's file",
        )
    if plan.strategy not in (None, _STRATEGY, *CONTROLLERS):
        raise UnknownNameError(
            f"no such strategy of controller {_BY_HAND}",
            got=plan.strategy,
            choices=(_STRATEGY, *CONTROLLERS),
        )
    refuse_solver_settings(plan)
    given = {
        "stack": scenario.stack is not None,
        "motions": bool(scenario.motions),
        "contacts": bool(scenario.contact_changes),
    }
    for what in (name for name, there in given.items() if there):
        raise ConfigurationError(
            f"controller {_BY_HAND} takes no {what}: it follows the devices", wanted=f"no {what}"
        )


def _check_limbs(scenario: Scenario, robot: Robot) -> None:
    """Refuse a robot without the soles and hands that a scenario's stack names."""
    plan = scenario.stack
    if plan is None:
        return
    recipes = [*plan.contacts, *(task for level in plan.levels for task in level)]
    named = [frame for r in recipes if isinstance(frame := getattr(r, "frame", None), str)]
    there = robot.frame_names()
    soles, hands = ([n for n in dict.fromkeys(named) if part in n] for part in ("sole", "hand"))
    # Where some are there, others are misspelt, and the list of names helps.
    soles, hands = ([] if {*names} & {*there} else names for names in (soles, hands))
    if not soles and not hands:
        return
    feet = "two feet" if len(soles) == 2 else "a foot" if soles else ""
    arms = "two hands" if len(hands) == 2 else "a hand" if hands else ""
    raise ConfigurationError(
        f"scenario {scenario.name!r} needs a robot with {' and '.join(filter(None, [feet, arms]))}",
        got=f"{robot.name} with soles {list(robot.soles)} and hands {list(robot.hands)}",
        wanted=f"a robot with {', '.join([*soles, *hands])}",
    )


def describe(scenario: Scenario, pushes: Sequence[Push]) -> dict[str, str]:
    """Metadata of a record, sufficient for a report without the run."""
    plan = scenario.controller
    events = [(push.at, f"push {push.body}", push.duration) for push in scenario.pushes]
    events += [
        (change.at, f"{'load' if change.load else 'unload'} {change.contact}", change.over)
        for change in scenario.contact_changes
    ]
    events += [(motion.at, f"{motion.task} moves", motion.over) for motion in scenario.motions]
    by_hand = plan.name == _BY_HAND
    strategy = _STRATEGY if by_hand else plan.strategy or check_plan(plan).strategies[0]
    return {
        "scenario": scenario.name,
        "description": scenario.description,
        "controller": plan.name,
        "strategy": strategy,
        "seed": str(scenario.seed),
        "events": json.dumps(events),
        "pushes": json.dumps([asdict(push) for push in pushes]),
    }
