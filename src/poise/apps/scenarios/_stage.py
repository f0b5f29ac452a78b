"""`stage_scenario`: a scenario on its robot, ready for a rollout."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

from poise.apps.scenarios._checks import validate_checks
from poise.apps.scenarios._controllers import cast_of, strategy_of, with_actuation
from poise.apps.scenarios._scenario import Scenario
from poise.apps.scenarios._size import (
    size_ratio,
    sized,
    sized_checks,
    without_hands,
)
from poise.control import Controller
from poise.errors import ConfigurationError
from poise.estimation import PayloadEstimator, StateEstimator
from poise.robots import Robot, load_robot
from poise.sim import Estimator, Plant, Push
from poise.stack import Leader


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """Who takes part in a scenario before its first tick: what `rollout` asks for.

    Attributes:
        scenario: with its lengths scaled to the robot, and the actuation and the blocks that its
            controller brings.
        robot: the robot.
        plant: the simulated robot, its pushes to come.
        controller: the scenario's.
        leader: moves targets and contacts along the scenario.
        estimator: says them where the robot is; nobody does when None.
        pushes: that the plant will be given.
    """

    scenario: Scenario
    robot: Robot
    plant: Plant
    controller: Controller
    leader: Leader
    estimator: Estimator | None
    pushes: tuple[Push, ...]


def stage_scenario(scenario: Scenario, robot: Robot | None = None) -> Stage:
    """Sets up a scenario: everything but the rollout and who looks at it.

    Args:
        scenario: what to set up.
        robot: what to set it up for; the scenario's own when None.

    Raises:
        PoiseError: the scenario does not fit its robot, or is walked by hand.
    """
    scenario = with_actuation(scenario)
    robot = load_robot(scenario.robot) if robot is None else robot
    ratio = size_ratio(scenario, robot)
    scenario = without_hands(sized(scenario, ratio), robot)
    _check_limbs(scenario, robot)
    cast = cast_of(scenario, robot)
    validate_checks(scenario.checks, cast.leader.stack, robot)
    checks = sized_checks(scenario.checks, cast.leader.stack, ratio)
    scenario = replace(scenario, checks=checks)
    estimator = cast.estimator
    if estimator is None and robot.floating_base and not scenario.ground_truth:
        payload = PayloadEstimator(robot)
        estimator = StateEstimator(robot, q_start=cast.q_start, payload=payload)
    blocks = scenario.plant.blocks + cast.blocks
    scenario = replace(scenario, plant=replace(scenario.plant, blocks=blocks))
    plant = Plant(robot, scenario.plant, seed=scenario.seed)
    plant.reset(cast.q_start)
    pushes = tuple(
        plant.push(push.body, push.force_on(robot.mass), push.duration, push.at)
        for push in scenario.pushes
    )
    return Stage(
        scenario=scenario,
        robot=robot,
        plant=plant,
        controller=cast.controller,
        leader=cast.leader,
        estimator=estimator,
        pushes=pushes,
    )


def _check_limbs(scenario: Scenario, robot: Robot) -> None:
    """Refuse a robot without the soles and hands that a scenario's stack names."""
    plan = scenario.stack
    if plan is None:
        return
    recipes = [*plan.contacts, *(task for level in plan.levels for task in level)]
    named = [frame for r in recipes if isinstance(frame := r.arguments.get("frame"), str)]
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
    """What a record says of the scenario, so that a report can be made of the record alone.

    Args:
        scenario: that is run.
        pushes: that its plant is given.
    """
    events = [(push.at, f"push {push.body}", push.duration) for push in scenario.pushes]
    events += [
        (change.at, f"{'load' if change.load else 'unload'} {change.contact}", change.over)
        for change in scenario.contact_changes
    ]
    events += [(motion.at, f"{motion.task} moves", motion.over) for motion in scenario.motions]
    return {
        "scenario": scenario.name,
        "description": scenario.description,
        "controller": scenario.controller.name,
        "strategy": strategy_of(scenario.controller),
        "seed": str(scenario.seed),
        "events": json.dumps(events),
        "pushes": json.dumps([asdict(push) for push in pushes]),
    }
