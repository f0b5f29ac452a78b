"""Robots whose servos let them sway over one foot are refused before anything moves."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from poise.apps.teleoperation import SCRIPTS, VELOCITY_TELEOP_PLANT, run_teleop
from poise.errors import ConfigurationError
from poise.locomotion import (
    ComShifter,
    Mode,
    ScriptedDevice,
    StepTeleoperator,
    WayPoint,
)


def with_ankles(robot, share):
    """The same robot, its ankles' roll by so much weaker."""
    torque = robot.tau_max.copy()
    for sole in robot.soles:
        torque[robot.leg_joints(sole)[-1] - 2] *= share
    return replace(robot, tau_max=torque)


@pytest.mark.parametrize("name", ["biped20", "humanoid33", "g1", "talos", "icub", "romeo"])
def test_robots_that_step_are_taken(get_robot, name):
    assert StepTeleoperator(get_robot(name), actuation="velocity")


def test_a_robot_with_weak_ankles_is_refused_with_the_reason_and_what_helps(get_robot):
    robot = with_ankles(get_robot("biped20"), 0.15)
    with pytest.raises(ConfigurationError, match="sway sideways") as refused:
        StepTeleoperator(robot, actuation="velocity")
    for said in ("left_ankle_roll", "9.65 N m", "/s", "actuation 'torque'", "servo_gains"):
        assert said in str(refused.value)
    assert StepTeleoperator(robot, actuation="torque")
    assert StepTeleoperator(robot, actuation="velocity", servo_gains=(700.0, 25.0))


@pytest.mark.parametrize("gains", [(0.0, 2.5), (70.0, -1.0), (np.nan, 2.5)])
def test_servo_gains_that_cannot_be_are_refused(get_robot, gains):
    with pytest.raises(ConfigurationError, match="of the servos"):
        StepTeleoperator(get_robot("biped20"), actuation="velocity", servo_gains=gains)


def test_weak_ankles_for_pitch_let_it_sway_forward(get_robot):
    robot = get_robot("biped20")
    torque = robot.tau_max.copy()
    torque[robot.leg_joints("right_sole")[-2] - 2] *= 0.1
    with pytest.raises(ConfigurationError, match="right_sole it would sway forward"):
        StepTeleoperator(replace(robot, tau_max=torque), actuation="velocity")


class Stiff(StepTeleoperator):
    def __init__(self, robot, *, servo_gains, **options):
        super().__init__(robot, servo_gains=(1e4, servo_gains[1]), **options)


def test_human_is_refused_and_would_not_stay_on_one_foot(get_robot):
    robot = get_robot("human")
    with pytest.raises(ConfigurationError, match=r"sway sideways.*left_ankle_X, 20 N m"):
        StepTeleoperator(robot, actuation="velocity")
    # Servos that are said to be stiff, and are not; the foot is to stay up.
    points = [WayPoint(at=0.5, right=(0.0, 0.0, 0.0)), WayPoint(at=1.0, right=(0.0, 0.0, 0.08))]
    run = run_teleop(
        robot,
        lambda teleoperator: ScriptedDevice(points, *teleoperator.estimator.anchors),
        VELOCITY_TELEOP_PLANT,
        duration=3.5,
        leader=Stiff,
        q_start=SCRIPTS["lift_one_foot"](robot).posture(robot),
    )
    lifted = run.log.entries(Mode.SL)[0]
    # It sways until it is about to fall, and puts the foot down in time.
    down = run.log.entries(Mode.D)[-1]
    assert run.fell or 0.5 < down - lifted < 2.0


def springs(robot, sole, gain):
    """Stiffness of a leg's joints, one after the other, under the CoM along x and y [N/m]."""
    data, step, gives = robot.model.createData(), 1e-6, np.zeros(2)

    def com(joint, angle):
        """Seen from the sole, with one joint turned."""
        q = robot.q_home.copy()
        q[7 + joint] += angle
        pin.framesForwardKinematics(robot.model, data, q)
        place = data.oMf[robot.frame_id(sole)]
        return place.rotation.T @ (pin.centerOfMass(robot.model, data, q) - place.translation)

    for joint in (joint - 2 for joint in robot.leg_joints(sole)):
        rate = (com(joint, step) - com(joint, -step))[:2] / (2.0 * step)
        gives += rate**2 / (gain * robot.tau_max[joint])
    return 1.0 / gives


def growth(stiffness, damping, shifter, leak=5.0):
    """Of the larger swings of a CoM that is held so, per mass, marched on in steps of 0.1 ms."""
    p, v, at, command, dt, peaks = 0.01, 0.0, 0.0, 0.0, 1e-4, []
    for tick in range(100_000):
        force = -stiffness * (p - at) - damping * (v - command)
        wanted = -shifter.kp * p - shifter.kd * command + leak * (v - command)
        before, v = v, v + dt * (shifter.omega**2 * p + force)
        p, at, command = p + dt * v, at + dt * command, command + dt * wanted
        if before > 0.0 >= v:
            peaks.append((tick * dt, p))
    (begin, low), (end, high) = peaks[-2:]
    return float(np.log(high / low) / (end - begin))


def test_the_sway_that_is_reported_is_that_of_springs_under_a_pendulum(get_robot):
    robot = with_ankles(get_robot("biped20"), 0.15)
    shifter = StepTeleoperator(get_robot("biped20"), actuation="velocity").driver
    with pytest.raises(ConfigurationError) as refused:
        StepTeleoperator(robot, actuation="velocity")
    found = re.search(r"by (\S+) /s, servos that hold the CoM at (\S+) rad/s", str(refused.value))
    stiffness = springs(robot, "left_sole", 70.0)[1] / robot.mass
    assert float(found[2]) == pytest.approx(np.sqrt(stiffness), abs=0.06)
    rate = growth(stiffness, stiffness * 2.5 / 70.0, shifter)
    assert float(found[1]) == pytest.approx(rate, rel=0.06)


def test_a_drivers_own_gains_are_what_is_tried(get_robot):
    robot, driver = get_robot("biped20"), ComShifter(0.765, kp=40.0, kd=0.5)
    with pytest.raises(ConfigurationError, match="it would sway"):
        StepTeleoperator(robot, actuation="velocity", driver=driver)
