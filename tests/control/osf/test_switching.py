"""Tasks go on and off and change places while a humanoid stands."""

import numpy as np
from random_switching import PERIOD, Switching

from poise.control import OperationalSpaceController
from poise.sim import Plant

SECONDS = 4.0


def test_random_hierarchies_every_tenth_of_a_second_throw_nobody_and_jerk_no_torque(get_any):
    robot = get_any("humanoid33")
    switching = Switching(robot, seed=0)
    bound = np.linspace(0.08, 0.12, robot.nj) * robot.tau_max
    controller = OperationalSpaceController(robot, switching.stack(), torque_step=bound)
    plant = Plant(robot)
    hands = [plant.data.site(name).xpos.copy() for name in robot.hands]
    start, every, last, steps, sizes = plant.com, round(PERIOD / 1e-3), None, [], set()
    for tick in range(round(SECONDS / 1e-3)):
        if tick and tick % every == 0:
            controller.set_levels(switching.levels())
            switching.move_targets(robot, hands)
            sizes.add(len(controller.stack.levels))
        command = controller.step(plant.state())
        assert command.status.ok
        if last is not None:
            steps.append((np.abs(command.torque - last) / bound).max())
        last = command.torque
        plant.step(command)
        assert not plant.fallen
    assert max(steps) <= 1.0 + 1e-9
    # The bound had something to do, and hierarchies of many shapes took part.
    assert max(steps) > 0.999
    assert len(sizes) >= 4
    assert np.linalg.norm(plant.com - start) < 0.02
    assert command.residuals[1] < 1e-6


def test_a_task_that_comes_back_holds_what_the_robot_does_then(get_any):
    robot = get_any("arm6")
    switching = OperationalSpaceController(robot)
    hand = switching.stack.levels[0][0]
    posture = switching.stack.levels[-1]
    plant = Plant(robot)
    plant.step(switching.step(plant.state()))
    first = hand.target_position.copy()
    switching.set_levels([posture])
    posture[0].set_target(robot.q_home + 0.3)
    for _ in range(300):
        plant.step(switching.step(plant.state()))
    switching.set_levels([[hand], posture])
    switching.step(plant.state())
    assert np.linalg.norm(hand.target_position - first) > 0.02
    assert np.linalg.norm(hand.error[:3]) < 1e-12


def test_a_task_that_stays_keeps_its_target(get_any):
    robot = get_any("arm6")
    controller = OperationalSpaceController(robot)
    hand, posture = controller.stack.levels[0][0], controller.stack.levels[-1]
    plant = Plant(robot)
    controller.step(plant.state())
    held = hand.target_position.copy()
    controller.set_levels([posture, [hand]])
    for _ in range(50):
        plant.step(controller.step(plant.state()))
    assert (hand.target_position == held).all()
