"""An operator who crosses the legs, where velocities are commanded and links touch each other."""

from dataclasses import replace

import numpy as np
import pytest
from walker import hands

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, BadOperator, run_teleop
from poise.dynamics import RobotState
from poise.locomotion import ScriptedDevice, StepTeleoperator, WayPoint
from poise.locomotion._stepping import _velocity_tasks
from poise.robots import capsules_of
from poise.sim import Plant
from poise.stack import SelfCollisionLimit

SEED = 21001
"""Of a bad operator under whom the feet of `biped20` met with 900 N, and it fell, after 2.3 s."""


def crossing(foot):
    """Lifts a foot, throws it far across the other one and puts it down there."""
    across = {"left": -0.4, "right": 0.4}[foot]
    places = ((0.1, 0.0, 0.0), (0.2, 0.0, 0.03), (0.8, 0.0, 0.06), (1.0, across, 0.06),
              (1.8, across, 0.06), (2.4, across, -0.04), (3.8, across, 0.0))  # fmt: skip
    return hands(*(WayPoint(at=at, **{foot: (0.0, y, z)}) for at, y, z in places))


@pytest.fixture
def touched(monkeypatch):
    """Runs a robot, and says whether it fell and the largest force of one link on another [N]."""
    forces, step = [0.0], Plant.step

    def watched(self, *args):
        step(self, *args)
        forces.extend(self.self_contacts.values())

    def run(robot, device, plant, **settings):
        forces[:] = [0.0]
        return run_teleop(robot, device, plant, **settings).fell, max(forces)

    monkeypatch.setattr(Plant, "step", watched)
    return run


@pytest.fixture
def free(monkeypatch):
    """Nothing keeps links apart."""
    off = SelfCollisionLimit(enabled=False)
    monkeypatch.setattr(_velocity_tasks, "SelfCollisionLimit", lambda **_: off)


def touching(error=(0.0087, 0.0)):
    plant = replace(VELOCITY_TELEOP_PLANT.with_noise(), self_contact=True)
    # An attitude that is off by half a degree has feet where they are not taken to be.
    return replace(plant, sensors=replace(plant.sensors, base_orientation_error=error))


def cross(touched, robot, foot):
    return touched(robot, crossing(foot), touching(), duration=3.4)


def lead_badly(touched, robot):
    plant = touching((-0.004091, 0.007708))
    return touched(robot, lambda t: BadOperator(t, SEED), plant, duration=3.2, seed=SEED)


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("foot", ["left", "right"])
@pytest.mark.parametrize("name", ["biped20", "g1"])
def test_legs_that_are_crossed_do_not_touch(get_robot, touched, name, foot):
    fell, force = cross(touched, get_robot(name), foot)
    assert not fell
    assert force == 0.0


@pytest.mark.slow
@pytest.mark.usefixtures("free")
def test_without_the_limit_those_of_a_robot_with_wide_feet_do(get_robot, touched):
    for foot in ("left", "right"):
        _, force = cross(touched, get_robot("g1"), foot)
        assert force > 10.0


def test_under_a_bad_operator_feet_do_not_touch(get_robot, touched):
    fell, force = lead_badly(touched, get_robot("biped20"))
    assert not fell
    assert force == 0.0


@pytest.mark.usefixtures("free")
def test_under_a_bad_operator_they_do_without_the_limit(get_robot, touched):
    _, force = lead_badly(touched, get_robot("biped20"))
    assert force > 300.0


def standing_velocities(robot, q):
    """What is commanded first in a posture with both feet on the ground [rad/s]."""
    teleoperator = StepTeleoperator(robot, q_start=q, actuation="velocity")
    teleoperator.device = ScriptedDevice([], *teleoperator.estimator.anchors)
    controller = teleoperator.controller()
    measured = RobotState(q, np.zeros(robot.nv))
    for k in range(5):
        estimate = teleoperator.estimator.update(replace(measured, time=0.005 * k))
        teleoperator.lead(estimate)
        command = controller.step(estimate)
        assert command.status.ok
    return command.velocity


def test_feet_that_stand_too_near_each_other_are_left_alone(get_robot, request):
    robot = get_robot("biped20")
    q, model = robot.q_home.copy(), robot.model
    for sole, inwards in zip(robot.soles, (-0.06, 0.06), strict=True):
        rolls = [j for j in robot.leg_joints(sole) if "roll" in model.names[j]]
        q[model.joints[rolls[0]].idx_q] += inwards
        q[model.joints[rolls[-1]].idx_q] -= inwards
    assert capsules_of(robot).distances(robot, q).min() < -0.02
    kept = standing_velocities(robot, q)
    request.getfixturevalue("free")
    np.testing.assert_array_equal(kept, standing_velocities(robot, q))
