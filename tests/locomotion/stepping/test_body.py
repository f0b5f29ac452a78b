"""Feet that are turned, the CoM's height, and the torso, as the operator commands them."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs
from slow import slow
from walker import hands, sample, up_and_down

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, replay_teleop, run_teleop
from poise.dynamics import Dynamics, RobotState
from poise.locomotion import (
    BodyCommand,
    Device,
    Mode,
    OperatorGuard,
    ScriptedDevice,
    StepTeleoperator,
    WayPoint,
)
from poise.sim import Block


class Asks:
    """Feet by way-points, and the same of the body all the time."""

    def __init__(self, feet, body):
        self._feet, self._body = feet, body

    def sample(self, time):
        return structs.replace(self._feet.sample(time), body=self._body)


def run(robot, body, points, duration, **options):
    plant = TORQUE_TELEOP_PLANT.with_noise()
    return run_teleop(
        robot, lambda t: Asks(hands(*points)(t), body), plant, duration=duration, **options
    )


def frames(robot, q, *names):
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    return [dynamics.frame(robot.frame_id(name)).rotation for name in names]


def yaw(rotation):
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))


@pytest.mark.parametrize("name", ["biped20", slow("g1")])
def test_a_foot_is_turned_in_the_air_and_the_trunk_faces_as_the_feet_do(get_robot, name):
    robot = get_robot(name)
    done = run(robot, BodyCommand(turns=(0.0, -0.4)), up_and_down(lift=0.1, lower=1.1), 2.8)
    assert not done.fell
    assert done.log.tilt.max() < 0.15
    assert len(done.log.entries(Mode.SL)) == 1
    assert done.log.mode[-1] == list(Mode).index(Mode.D)
    left, right, pelvis = frames(robot, done.log.q[-1], *robot.soles, robot.pelvis)
    assert yaw(left) == pytest.approx(0.0, abs=0.02)
    assert yaw(right) == pytest.approx(-0.4, abs=0.01)
    assert yaw(pelvis) == pytest.approx(-0.2, abs=0.04)
    assert right[2, 2] > 0.9999


def test_what_is_asked_of_the_body_is_recorded_and_comes_again(get_robot, tmp_path):
    robot, path = get_robot("biped20"), tmp_path / "turned.mcap"
    body = BodyCommand(height=-0.03, torso=(0.1, 0.1, -0.1), turns=(0.0, -0.4))
    done = run(robot, body, up_and_down(lift=0.1), 1.2, recording=path)
    again = replay_teleop(path, robot)
    assert len(done.log.entries(Mode.SL)) == 1
    assert np.array_equal(again.log.command, done.log.command)


@pytest.mark.slow
def test_feet_are_turned_no_further_than_they_may_be_against_each_other(get_robot):
    robot = get_robot("biped20")
    done = run(robot, BodyCommand(turns=(0.0, 2.0)), up_and_down(), 4.6)
    left, right = frames(robot, done.log.q[-1], *robot.soles)
    assert yaw(right) - yaw(left) == pytest.approx(0.12, abs=0.02)
    assert not done.fell


@pytest.mark.slow
@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_the_body_comes_down_and_the_torso_bows_and_turns(get_robot, name):
    robot = get_robot(name)
    done = run(robot, BodyCommand(height=-0.06, torso=(0.1, 0.2, -0.3)), [], 3.0)
    log = done.log
    assert not done.fell
    assert log.com[-1, 2] - log.com[0, 2] == pytest.approx(-0.06, abs=0.01)
    np.testing.assert_allclose(log.com[-1, :2], log.zmp_reference[-1], atol=0.01)
    (torso,) = frames(robot, log.q[-1], robot.torso)
    assert yaw(torso) == pytest.approx(-0.3, abs=0.04)
    assert -torso[2, 0] == pytest.approx(np.sin(0.2), abs=0.03)


@pytest.mark.slow
def test_a_torso_leans_as_told_on_a_waist_that_does_not(get_robot):
    robot = get_robot("talos")
    done = run(robot, BodyCommand(torso=(0.2, 0.0, 0.0)), [], 3.0)
    assert not done.fell
    (torso,) = frames(robot, done.log.q[-1], robot.torso)
    assert torso[2, 1] == pytest.approx(np.sin(0.2), abs=0.01)


def test_what_is_no_number_leaves_the_body_as_it_was():
    guard = OperatorGuard(dt=0.005, low=0.01, press_depth=0.08)
    soles = [np.array(sample(0.0).place(foot)) for foot in (0, 1)]
    good = BodyCommand(height=-0.05, turns=(0.1, 0.0))
    for k, body in enumerate((good, BodyCommand(height=np.nan), BodyCommand(turns=(0.0, np.inf)))):
        told = sample(0.005 * k, body=body)
        assert guard.check(told, 0.005 * k, soles, soles).body == good


@pytest.mark.parametrize("turned", [0.4, -0.5])
def test_the_trunk_faces_as_feet_do_that_have_turned_on_their_ground(get_robot, turned):
    """Nobody commanded that; states are made up."""
    robot = get_robot("g1")
    teleoperator = StepTeleoperator(robot, actuation="torque")
    q = robot.q_home.copy()
    q[robot.nq - robot.nj + robot.joint_index("left_hip_yaw_joint")] += turned
    wrench = np.array([0.0, 0.0, 0.5 * robot.weight, 0.0, 0.0, 0.0])
    contacts = dict.fromkeys(teleoperator.soles, wrench)
    state = RobotState(q, np.zeros(robot.nv), contacts)
    for tick in range(500):
        measured = replace(state, time=0.002 * tick)
        teleoperator.lead(teleoperator.estimator.update(measured))
    left, right = frames(robot, q, *teleoperator.soles)
    facing = 0.5 * (yaw(left) + yaw(right))
    assert abs(facing) > 0.4 * abs(turned)
    tasks = {task.name: task for level in teleoperator.stack.levels for task in level}
    assert yaw(tasks["pelvis orientation"].target_rotation) == pytest.approx(facing, abs=1e-3)


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


@pytest.mark.parametrize("outwards", [-0.03, 0.03])
def test_g1_stands_still_with_one_edge_of_a_sole_on_a_ridge(get_robot, outwards):
    """2 cm high, under one half of the right sole, along it: steeper than its ankle rolls.

    Before, it shook, with 50 to 100 N of standard deviation on each foot, and leaned by 0.26 and
    0.64 rad.
    """
    robot = get_robot("g1")
    stride, start = 0.15, StepTeleoperator(robot).estimator.anchors[1]
    ridge = Block(
        center=(float(start[0]) + stride, float(start[1]) - outwards), size=(0.2, 0.03, 0.02)
    )
    places = (
        (0.5, (0.0, 0.0, 0.0)),
        (0.9, (0.0, 0.0, 0.08)),
        (1.6, (stride, 0.0, 0.08)),
        (2.3, (stride, 0.0, -0.03)),
        (2.6, (stride, 0.0, -0.01)),
    )
    points = [WayPoint(at=at, right=place) for at, place in places]
    run = run_teleop(
        robot,
        lambda t: ScriptedDevice(points, *t.estimator.anchors),
        replace(TORQUE_TELEOP_PLANT, blocks=(ridge,)),
        duration=5.0,
        seed=7,
    )
    log = run.log
    assert not run.fell
    still = log.time > 3.5
    assert log.loads[still].min(axis=0).min() > 50.0
    assert log.loads[still].std(axis=0).max() < 15.0
    assert log.tilt[still].max() < 0.05
