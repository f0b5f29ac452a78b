"""The self-collision limit in controllers, with a plant whose links touch one another."""

import numpy as np
import pytest
from oracles import near_home

from poise.control import (
    DifferentialIK,
    OperationalSpaceController,
    ReducedController,
    WholeBodyController,
)
from poise.dynamics import Dynamics, RobotState
from poise.robots import capsules_of
from poise.sim import Plant, PlantConfig
from poise.stack import SelfCollisionLimit, Stack, TorqueLimit, default_stack

CONTROLLERS = [WholeBodyController, ReducedController, OperationalSpaceController]


def stack_of(robot, *, enabled=True, rate=250.0):
    plain = default_stack(robot)
    return Stack(
        plain.contacts,
        plain.levels,
        torque_limit=TorqueLimit(rate=rate),
        self_collision_limit=SelfCollisionLimit(enabled=enabled),
    )


def led_into(robot, what, make, *, enabled, seconds=1.2):
    """Hands led into the trunk or each other; largest self-contact [N] and least distance [m]."""
    stack = stack_of(robot, enabled=enabled)
    controller = make(robot, stack)
    plant = Plant(robot, PlantConfig(control_dt=0.002, self_contact=True))
    controller.step(plant.state())
    left, right = (stack.task(f"{hand} pose") for hand in robot.hands)
    starts = left.target_position.copy(), right.target_position.copy()
    torso, _ = Dynamics(robot).placement(robot.frame_id(robot.torso))
    middle = 0.5 * (starts[0] + starts[1]) + [0.2, 0.0, 0.1]
    goals = {
        "trunk": (torso + [0.0, 0.0, 0.05], starts[1]),
        "other hand": (middle - [0.0, 0.1, 0.0], middle + [0.0, 0.1, 0.0]),
    }[what]
    force, least = 0.0, np.inf
    while plant.time < seconds:
        part = min(plant.time / 0.5, 1.0)
        for task, start, goal in zip((left, right), starts, goals, strict=True):
            task.set_target(start + part * (goal - start))
        plant.step(controller.step(plant.state()))
        force = max([force, *plant.self_contacts.values()])
        least = min([least, *(pair.distance for pair in stack.self_collision_limit.near)])
    assert not plant.fallen
    return force, least


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("name", ["humanoid33", "g1"])
@pytest.mark.parametrize("what", ["trunk", "other hand"])
def test_hands_that_are_led_into_the_robot_stop_before_it(get_robot, name, what):
    robot = get_robot(name)
    force, _ = led_into(robot, what, WholeBodyController, enabled=False)
    assert force > 100.0
    force, least = led_into(robot, what, WholeBodyController, enabled=True)
    assert force == 0.0
    # Upper arms hang beside the trunk, their capsules at its own: -1 cm is their margin.
    assert least > -0.025


@pytest.mark.parametrize("make", [ReducedController, OperationalSpaceController])
def test_every_controller_of_torques_keeps_links_apart(get_robot, make):
    force, _ = led_into(get_robot("g1"), "trunk", make, enabled=True)
    assert force == 0.0


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize("make", CONTROLLERS)
@pytest.mark.parametrize("seed", range(4))
def test_rows_are_kept_in_a_tick(get_robot, make, seed):
    robot = get_robot("humanoid33")
    state = near_home(robot, seed, spread=0.05, speed=0.1)
    stack = stack_of(robot, rate=None)
    controller = make(robot, stack)
    command = controller.step(state)
    assert command.status.ok
    far = stack.task("left_hand pose").target_position + [-0.3, -0.5, 0.0]
    stack.task("left_hand pose").set_target(far)
    command = controller.step(state)
    assert command.status.ok
    rows = [r for r in stack.self_collision_limit.near if r.distance < 0.5]
    assert len(rows) == 10
    own = stack.self_collision_limit.rows_for(stack.contacts)
    bound = own.reference - own.drift
    kept = own.jacobian @ command.acceleration - bound
    scale = 1.0 + np.abs(bound[np.isfinite(bound)]).max()
    # The closed form gives up rounds before it gives up what is above.
    missed = 0.5 if make is OperationalSpaceController else 1e-6
    assert kept[np.isfinite(kept)].min() > -missed * scale


@pytest.mark.parametrize("seed", range(4))
def test_the_reduced_controller_answers_as_the_whole_one(get_robot, seed):
    robot = get_robot("g1")
    state = near_home(robot, seed, spread=0.05, speed=0.2)
    answers = []
    for make in (WholeBodyController, ReducedController):
        stack = stack_of(robot)
        controller = make(robot, stack)
        controller.step(state)
        target = stack.task("left_hand pose").target_position + [-0.2, -0.4, 0.0]
        stack.task("left_hand pose").set_target(target)
        controller.reset()
        stack.task("left_hand pose").set_target(target)
        answers.append(controller.step(state).torque)
    np.testing.assert_allclose(answers[1], answers[0], rtol=0, atol=1e-5 * np.abs(answers[0]).max())


def test_what_is_far_from_itself_is_not_touched(get_robot):
    robot = get_robot("humanoid33")
    state = near_home(robot, 0, spread=0.0, speed=0.0)
    torques = [
        WholeBodyController(robot, stack_of(robot, enabled=enabled)).step(state).torque
        for enabled in (False, True)
    ]
    np.testing.assert_allclose(torques[1], torques[0], rtol=0, atol=1e-8 * np.abs(torques[0]).max())


@pytest.mark.parametrize("strategy", ["closed_form", "hqp"])
def test_velocities_take_no_hand_into_the_trunk(get_robot, strategy):
    robot = get_robot("g1")
    least = {}
    for enabled in (False, True):
        stack = stack_of(robot, enabled=enabled)
        controller = DifferentialIK(robot, stack, dt=0.01, strategy=strategy)
        capsules, q = capsules_of(robot), robot.q_home.copy()
        margins = np.minimum(0.02, capsules.at_home - 0.01)
        controller.step(RobotState(q, np.zeros(robot.nv)))
        hand, start = stack.task("left_hand pose"), stack.task("left_hand pose").target_position
        torso, _ = Dynamics(robot).placement(robot.frame_id(robot.torso))
        nearest = np.inf
        for k in range(150):
            hand.set_target(start + min(k / 50, 1.0) * (torso - start))
            command = controller.step(RobotState(q, np.zeros(robot.nv)))
            assert command.status.ok
            # The base stays: the arm alone is looked at.
            q[-robot.nj :] += 0.01 * command.velocity
            left = [i for i, n in enumerate(capsules.names) if n.startswith("left_wrist")]
            arms = np.isin(capsules.pairs, left).any(axis=1)
            trunk = np.array(
                [capsules.names[i] == "torso_link" for i in range(len(capsules.names))]
            )
            chosen = arms & trunk[capsules.pairs].any(axis=1)
            nearest = min(nearest, (capsules.distances(robot, q) - margins)[chosen].min())
        least[enabled] = nearest
    assert least[False] < -0.03
    assert least[True] > -2e-3
