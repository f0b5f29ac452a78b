"""`stage_scenario`: a scenario on its robot, ready for a rollout that somebody else looks at."""

from dataclasses import dataclass

from poise.apps.scenarios._by_hand import ByHand
from poise.apps.scenarios._controllers import controller_of, with_actuation
from poise.apps.scenarios._director import Director
from poise.apps.scenarios._scenario import Scenario
from poise.control import Controller
from poise.errors import ScenarioError
from poise.robots import load_robot
from poise.sim import Plant
from poise.stack import Leader


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """Who takes part in a scenario before its first tick: what `rollout` asks for.

    Attributes:
        plant: the simulated robot, its pushes to come.
        controller: the scenario's.
        leader: moves targets and contacts along the scenario.
    """

    plant: Plant
    controller: Controller
    leader: Leader


def stage_scenario(scenario: Scenario) -> Stage:
    """Sets up a scenario that a stack leads: everything but the loop, the record and the checks.

    Args:
        scenario: what to set up.

    Raises:
        PoiseError: the scenario does not fit its robot, or is walked by hand.
    """
    scenario = with_actuation(scenario)
    robot = load_robot(scenario.robot)
    controller = controller_of(scenario, robot)
    if isinstance(controller, ByHand):
        raise ScenarioError(
            f"scenario {scenario.name!r} has no stack to lead",
            got=scenario.controller.name,
            wanted="a scenario that is not walked by hand",
        )
    leader = Director(scenario, controller.stack, robot)
    plant = Plant(robot, scenario.plant, seed=scenario.seed)
    for push in scenario.pushes:
        plant.push(push.body, push.force_on(robot.mass), push.duration, push.at)
    return Stage(plant=plant, controller=controller, leader=leader)
