"""What holds the trunk off its orientation for long: by made-up motions, and in the loop."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from walker import hands, sample

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.locomotion import BodyCommand, Device
from poise.locomotion._stepping._by_torque._departures import TrunkFeedback

DT, KP = 0.002, 100.0
LEANING, THROWN = pin.exp3(np.array([0.2, -0.2, 0.0])), pin.exp3(np.array([0.4, 0.0, 0.0]))


def learned(feedback, goal, here, *, learns=True):
    """The acceleration after a tick of feedback."""
    target = np.concatenate((np.zeros(3), goal.ravel(), np.zeros(12)))
    feedback.apply(target, np.ascontiguousarray(here), learns=learns)
    return target[21:]


def turned(disturbance, seconds, *, goal=(0.0, 0.0, 0.0), learns=True):
    """How far a trunk is from its goal that a spring, a damper and a disturbance turn [rad]."""
    feedback, sent = TrunkFeedback(DT), pin.exp3(np.array(goal))
    here, rate = sent.copy(), np.zeros(3)
    for _ in range(round(seconds / DT)):
        lasting = learned(feedback, sent, here, learns=learns)
        error = pin.log3(sent @ here.T)
        rate = rate + DT * (KP * error - 2.0 * math.sqrt(KP) * rate + lasting + disturbance)
        here = pin.exp3(DT * rate) @ here
    return pin.log3(sent @ here.T)


@pytest.mark.parametrize("goal", [(0.0, 0.0, 0.0), (0.1, 0.2, 2.0)])
def test_a_lasting_disturbance_is_made_up_for_about_horizontal_axes(goal):
    across = pin.exp3(np.array(goal)) @ np.array([12.0, -9.0, 0.0])
    assert np.linalg.norm(turned(across, 12.0, goal=goal, learns=False)) > 0.1
    assert np.linalg.norm(turned(across, 12.0, goal=goal)) < 0.003


def test_about_the_vertical_nothing_is_learned():
    about = np.array([0.0, 0.0, 10.0])
    np.testing.assert_allclose(turned(about, 12.0), turned(about, 12.0, learns=False), atol=1e-6)


def test_what_is_learned_is_bounded():
    feedback = TrunkFeedback(DT)
    for _ in range(20000):
        found = learned(feedback, LEANING, np.eye(3))
    np.testing.assert_allclose(found, (30.0, -30.0, 0.0), atol=1e-9)


def test_a_trunk_that_has_been_thrown_teaches_nothing():
    feedback = TrunkFeedback(DT)
    for _ in range(500):
        found = learned(feedback, np.eye(3), THROWN)
    np.testing.assert_array_equal(found, np.zeros(3))


def test_what_has_been_learned_is_kept_while_nothing_is():
    feedback = TrunkFeedback(DT)
    found = learned(feedback, LEANING, np.eye(3))
    assert np.linalg.norm(found) > 0.0
    kept = learned(feedback, np.eye(3), LEANING, learns=False)
    np.testing.assert_allclose(kept, LEANING @ found, atol=1e-12)


def test_a_torso_that_cannot_be_bent_as_asked_is_upright_again_afterwards(get_robot):
    """The waist of TALOS stops before that: pelvis and torso would wind each other up."""
    robot = get_robot("talos")

    def bends(teleoperator):
        left, right = teleoperator.estimator.anchors

        class Bending(Device):
            def sample(self, time):
                asked = (0.0, -0.4, 0.0) if 0.1 < time < 0.9 else (0.0, 0.0, 0.0)
                return sample(time, left, right, body=BodyCommand(torso=asked))

        return Bending()

    log = run_teleop(robot, bends, duration=2.3).log
    assert log.tilt[log.time < 0.9].max() > 0.1
    assert log.tilt[log.time > 2.1].max() < 0.01


@pytest.mark.slow
def test_g1_whose_load_cells_are_off_stands_upright(get_robot):
    """They look like a centre of mass somewhere else, by which the trunk would lean."""
    robot = get_robot("g1")
    off = 0.01 * robot.weight
    plant = TORQUE_TELEOP_PLANT.with_noise()
    plant = replace(plant, sensors=replace(plant.sensors, force_bias=off, moment_bias=0.1 * off))
    run = run_teleop(robot, hands(), plant, duration=16.0, seed=115)
    assert not run.fell
    assert np.linalg.norm(np.array(run.record["payload_estimate"])[-1, 1:]) > 0.005
    assert run.log.tilt[-1] < 0.04
