"""Balance on one foot whose sole is too narrow for a push outwards."""

import math

import numpy as np
import pytest
from made_up import MadeUp, leaning
from walker import hands

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.locomotion import DeviceStatus, Mode, StepTeleoperator, WayPoint


@pytest.mark.parametrize(("inwards", "lifted"), [(0.021, True), (0.0255, False), (0.0075, True)])
@pytest.mark.parametrize("foot", [0, 1])
def test_a_foot_is_lifted_where_the_zmp_brings_the_robot_back(get_robot, foot, inwards, lifted):
    """Farther inwards than the ZMP gets the DCM would only go on. States are made up."""
    made = MadeUp(get_robot("g1"))
    made.q = leaning(made.robot, foot, inwards)
    made.until(0.1)
    made.up = (0.0, 0.06) if foot == 0 else (0.06, 0.0)
    while not made.mode.single and made.time < 1.5:
        made.tick()
    assert made.mode.support == foot
    assert made.mode.single == lifted


@pytest.mark.parametrize(("name", "ahead", "up"), [("g1", 0.75, 0.5), ("biped20", 1.0, 1.0)])
def test_a_foot_beside_a_narrow_one_is_not_led_as_far_nor_as_high(get_robot, name, ahead, up):
    robot = get_robot(name)
    velocity = StepTeleoperator(robot, actuation="velocity").parameters
    torque = StepTeleoperator(robot, actuation="torque").parameters
    assert torque.step_max == pytest.approx(ahead * velocity.step_max)
    assert torque.lift_max == pytest.approx(up * velocity.lift_max)


@pytest.mark.slow
@pytest.mark.parametrize(("forward", "degrees"), [(0.0, 270), (0.2, 250), (-0.2, 300)])
def test_g1_on_one_foot_leans_against_a_push_outwards_and_steps_nowhere(
    get_robot, forward, degrees
):
    """Its leg helps, not by more than 40 cm, and is back where it is held: its foot stays up."""
    robot, seed, at = get_robot("g1"), 3, 2.6
    angle, force = math.radians(degrees), robot.mass * 0.2 / 0.1
    push = (force * math.cos(angle), force * math.sin(angle), 0.0)
    plant = TORQUE_TELEOP_PLANT.with_noise()
    points = [
        WayPoint(at=0.2, left=(0.0, 0.0, 0.0)),
        WayPoint(at=0.8, left=(0.0, 0.0, 0.1)),
        WayPoint(at=1.8, left=(forward, 0.0, 0.12)),
    ]
    pushes = [(round(at / plant.control_dt), push, 0.1)]
    run = run_teleop(robot, hands(*points), plant, duration=6.0, seed=seed, pushes=pushes)
    log = run.log
    assert not run.fell
    assert not (log.device == list(DeviceStatus).index(DeviceStatus.OVERRULED)).any()
    after = log.time > at
    assert (log.mode[after] == list(Mode).index(Mode.SR)).all()
    # Beyond what the sole alone holds.
    half = 0.5 * next(iter(robot.soles.values())).width
    xi = log.com[:, 1] + np.gradient(log.com[:, 1], log.time) / 3.8
    assert (log.soles[after, 1, 1] - xi[after]).max() > half
    place = log.soles[~after, 0][-1]
    assert np.abs(log.soles[after, 0] - place).max() < 0.4
    assert log.tilt.max() < 0.6
    assert np.linalg.norm(log.soles[-1, 0] - place) < 0.03
    assert log.tilt[-1] < 0.1
