"""A standing robot that a hoist lifts and sets down, with estimator, noise and delay."""

import math

import numpy as np
import pytest

from poise.control import WholeBodyController
from poise.locomotion import Walker, walking_stack
from poise.locomotion._walking._settings import WalkStatus
from poise.sim import Plant, PlantConfig, rollout
from studies.locomotion.late_estimate import PERIOD, LateEstimate, typical_sensors

SHOULDERS = "left_shoulder_pitch_link", "right_shoulder_pitch_link"
SAG, LENGTH = 0.05, 1.0
"""Stretch of the straps under the robot, and their length [m]."""


class Hoist:
    """Two straps at the shoulders, over which they hang."""

    def __init__(self, plant, robot):
        self.plant = plant
        self.stiffness = 0.5 * robot.weight / SAG
        self.damping = math.sqrt(0.5 * robot.mass * self.stiffness)
        self.before = self.start = self.places()

    def places(self):
        return np.array([self.plant.data.body(link).xipos for link in SHOULDERS])

    def pull(self, height):
        """Pull for a tick, with the hook raised by a height [m]."""
        places, before = self.places(), self.before
        self.before = places
        for link, place, rate, start in zip(
            SHOULDERS, places, (places - before) / PERIOD, self.start, strict=True
        ):
            taut = self.stiffness * (start[2] + height - place[2])
            force = max(taut - self.damping * rate[2], 0.0) if taut > 0.0 else 0.0
            if force > 0.0:
                aside = -force / LENGTH * (place - start)[:2] - self.damping / LENGTH * rate[:2]
                start_time = self.plant.time + PERIOD
                self.plant.push(link, (*aside, force), PERIOD, start_time)


@pytest.mark.parametrize(("name", "height"), [("g1", 0.1), ("humanoid33", 0.03)])
def test_a_robot_that_a_hoist_lifts_hangs_still_stands_and_walks_again(get_robot, name, height):
    robot = get_robot(name)
    plant = Plant(robot, PlantConfig(control_dt=PERIOD, sensors=typical_sensors()), seed=4)
    plant.reset(None)
    stack = walking_stack(robot)
    walker, hoist = Walker(robot, stack), Hoist(plant, robot)
    estimator = LateEstimate(robot, q_start=plant.true_state().q)
    ticks = rollout(
        plant, WholeBodyController(robot, stack), walker, estimator=estimator, duration=10.0
    )
    said, torque = set(), 0.0
    for tick in ticks:
        hoist.pull(
            np.interp(tick.time, (0.5, 2.0, 3.0, 5.5), (-0.02, SAG + height, SAG + height, -0.15))
        )
        if 2.5 < tick.time < 3.0:
            said.add(walker.status)
            torque = max(torque, float(np.abs(tick.command.torque / robot.tau_max).max()))
        walker.set_velocity(0.2 if 7.0 < tick.time < 9.0 else 0.0)
    assert said == {WalkStatus.LIFTED}
    assert torque < 0.5
    assert not plant.fallen
    assert walker.steps_made >= 2
