"""Robots whose servos let them sway over one foot are refused before anything moves."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from legs import leg_joints
from standing import biped as biped_at_home

from poise.apps.teleoperation import SCRIPTS, VELOCITY_TELEOP_PLANT, run_teleop
from poise.errors import ConfigurationError
from poise.locomotion import (
    ComShifter,
    Mode,
    ScriptedDevice,
    StepTeleoperator,
    WayPoint,
)
from poise.locomotion._stepping._velocity_level import sway_growth, sway_stiffness
from poise.robots import GRAVITY

OMEGA, LEAK = 3.5, 5.0


def shifter_of(kp=40.0, kd=None):
    return ComShifter(GRAVITY / OMEGA**2, kp=kp, kd=kd)


def with_ankles(robot, share):
    """The same robot, its ankles' roll by so much weaker."""
    torque = robot.tau_max.copy()
    for sole in list(robot.soles)[:2]:
        torque[leg_joints(robot, sole)[-1]] *= share
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
    torque[leg_joints(robot, "right_sole")[-2]] *= 0.1
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


def test_stiff_servos_leave_the_pendulums_own_pole():
    assert sway_growth(1e6, 1e5, shifter_of(), LEAK) == pytest.approx(-OMEGA, rel=1e-3)


@pytest.mark.parametrize(("kp", "kd"), [(40.0, None), (60.0, None), (40.0, 12.0)])
def test_sway_grows_as_the_difference_equations_do(kp, kd):
    """The model marched on in steps of 0.1 ms, by itself."""
    stiffness = 2.0 * OMEGA**2
    p, v, at, command = 0.01, 0.0, 0.0, 0.0
    gains = shifter_of(kp, kd)
    kd = kp / OMEGA + OMEGA if kd is None else kd
    damping = stiffness * 2.5 / 70.0
    dt, peaks = 1e-4, []
    for _ in range(100_000):
        force = -stiffness * (p - at) - damping * (v - command)
        wanted = -kp * p - kd * command + LEAK * (v - command)
        before = v
        v += dt * (OMEGA**2 * p + force)
        p += dt * v
        at += dt * command
        command += dt * wanted
        if before > 0.0 >= v:
            peaks.append(p)
    period = 2.0 * np.pi / np.abs(frequency(stiffness, damping, kp, kd))
    rate = np.log(peaks[-1] / peaks[-2]) / period
    assert rate == pytest.approx(sway_growth(stiffness, damping, gains, LEAK), rel=0.01)


def frequency(stiffness, damping, kp, kd):
    """Of the swing that grows [rad/s], from the characteristic polynomial."""
    k, d, leak = stiffness, damping, LEAK
    plant, spring = np.poly1d([1.0, d, k - OMEGA**2]), np.poly1d([d, k])
    s = np.poly1d([1.0, 0.0])
    # p (plant) = spring P, s P = V, V (s + kd + leak) = (leak s - kp) p.
    roots = (plant * s * (s + kd + leak) - spring * (leak * s - kp)).roots
    return roots[np.argmax(roots.real)].imag


@pytest.mark.parametrize("foot", [0, 1])
def test_the_stiffness_is_that_of_springs_one_after_the_other(get_robot, foot):
    robot = get_robot("biped20")
    dynamics = StepTeleoperator(robot, actuation="velocity").estimator.dynamics
    biped = biped_at_home(robot)
    sole, data, step = biped.soles[foot], robot.model.createData(), 1e-6

    def com(joint, angle):
        """Seen from the sole, with one joint turned."""
        q = robot.q_home.copy()
        q[7 + joint] += angle
        pin.framesForwardKinematics(robot.model, data, q)
        place = data.oMf[robot.frame_id(sole)]
        return place.rotation.T @ (pin.centerOfMass(robot.model, data, q) - place.translation)

    gives = np.zeros(2)
    for joint in leg_joints(robot, sole):
        rate = (com(joint, step) - com(joint, -step))[:2] / (2.0 * step)
        gives += rate**2 / (70.0 * robot.tau_max[joint])
    stiffness, weakest = sway_stiffness(biped, dynamics, foot, 70.0)
    assert stiffness == pytest.approx(1.0 / gives, rel=1e-5)
    assert weakest[1].endswith("ankle_roll")


def test_a_drivers_own_gains_are_what_is_tried(get_robot):
    robot, driver = get_robot("biped20"), ComShifter(0.765, kp=40.0, kd=0.5)
    with pytest.raises(ConfigurationError, match="it would sway"):
        StepTeleoperator(robot, actuation="velocity", driver=driver)
