"""An arm is stretched straight and asked for more, slowly and fast."""

import math

import numpy as np
import pytest
from osf_world import missing

from poise.control import OperationalSpaceController
from poise.sim import Plant
from poise.stack import ComTask, FrameTask, PostureTask, Stack, SurfaceContact

SHOULDERS = {"arm6": ([0.0, 0.0, 0.30], 0.90), "panda": ([0.0, 0.0, 0.333], 0.855)}
"""Where reach is measured from, and how far it goes [m]."""


class Pull:
    """A hand's target moves on a straight line to 1.2 times the reach, and stays there."""

    def __init__(self, robot, hand, controller, shoulder, reach, speed):
        self.robot, self.hand, self.controller = robot, hand, controller
        self.plant = Plant(robot)
        start = np.array(self.plant.data.site(hand.frame).xpos)
        away = np.array([1.0, 0.3, 0.2]) if len(robot.hands) < 2 else np.array([0.7, 1.0, 0.3])
        end = np.asarray(shoulder) + 1.2 * reach * away / np.linalg.norm(away)
        # Slowly means the last stretch only.
        if speed < 0.5:
            start = start + 0.6 * (end - start)
        self.start, self.way = start, end - start
        self.duration = float(np.linalg.norm(self.way)) / speed

    def run(self, seconds):
        """Command after command, with the worst torque ratio and step over the limit."""
        last, self.steps, self.ratio = None, [], 0.0
        tau_max = self.robot.tau_max
        while self.plant.time < seconds:
            share = self.plant.time / self.duration
            moving = np.concatenate((self.way / self.duration, np.zeros(3))) if share < 1 else None
            self.hand.set_target(self.start + min(share, 1.0) * self.way, None, moving)
            command = self.controller.step(self.plant.state())
            assert command.status.ok
            self.ratio = max(self.ratio, float((np.abs(command.torque) / tau_max).max()))
            if last is not None:
                self.steps.append((np.abs(command.torque - last) / tau_max).max())
            last = command.torque
            yield command
            self.plant.step(command)


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("name", ["arm6", "panda"])
@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_an_arm_pulled_beyond_its_reach_keeps_its_torques_and_their_steps_bounded(
    get_any, name, speed
):
    robot = get_any(name)
    hand = FrameTask(robot.hands[0], "position")
    controller = OperationalSpaceController(robot, Stack(levels=[[hand], [PostureTask()]]))
    pull = Pull(robot, hand, controller, *SHOULDERS[name], speed)
    lost = 0
    for _ in pull.run(pull.duration + 0.5 if speed > 0.5 else min(pull.duration, 2.5)):
        lost += controller.strategy.recursion.regular < 2
    # It went through the singularity.
    assert lost > 20
    assert pull.ratio <= 1.0 + 1e-12
    assert max(pull.steps) <= 0.1 + 1e-9
    assert not pull.plant.diverged


@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_a_humanoid_that_reaches_too_far_keeps_balance_above_its_hand(get_any, speed):
    """CoM and pelvis have priority: to 1e-3 in every tick; and the torques do not jump."""
    robot = get_any("humanoid33")
    com, pelvis = ComTask(), FrameTask(robot.pelvis, "orientation")
    hand = FrameTask(robot.hands[0], "position")
    stack = Stack(
        [SurfaceContact(sole) for sole in robot.soles], [[com, pelvis], [hand], [PostureTask()]]
    )
    controller = OperationalSpaceController(robot, stack)
    plant = Plant(robot)
    shoulder = np.array(plant.data.site(robot.torso).xpos)
    pull = Pull(robot, hand, controller, shoulder, 0.9, speed)
    start = pull.plant.com
    for command in pull.run(pull.duration + 0.3 if speed > 0.5 else pull.duration):
        for task in (com, pelvis):
            assert np.abs(missing(task, command.acceleration)).max() < 1e-3
    assert pull.ratio <= 1.0 + 1e-12
    assert max(pull.steps) <= 0.1 + 1e-9
    assert not pull.plant.fallen
    assert np.linalg.norm(pull.plant.com - start) < 0.01
    # It did reach, as far as it can.
    assert 0.05 < np.linalg.norm(hand.error) < 0.4


def test_without_a_bound_torques_still_seldom_change_much(get_any):
    """The bound is a safety net: nearly all ticks change every torque by less than 3%."""
    robot = get_any("arm6")
    hand = FrameTask(robot.hands[0], "position")
    controller = OperationalSpaceController(
        robot, Stack(levels=[[hand], [PostureTask()]]), torque_step=math.inf
    )
    pull = Pull(robot, hand, controller, *SHOULDERS["arm6"], 0.3)
    for _ in pull.run(pull.duration + 0.3):
        pass
    assert np.quantile(pull.steps, 0.95) < 0.03
