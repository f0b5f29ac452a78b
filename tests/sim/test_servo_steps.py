"""Servos at the limit of their torque: joints that are light beside them do not rattle."""

from dataclasses import replace

import numpy as np
import pytest
from small_biped import velocity

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT
from poise.sim import Plant

HIPS = ("left_hip_pitch_joint", "right_hip_pitch_joint")


def jerked(robot, physics_dt, speed):
    """Velocities of a hip that is told a speed for 5 ms, in the air, each millisecond [rad/s]."""
    plant = Plant(robot, replace(VELOCITY_TELEOP_PLANT, physics_dt=physics_dt, control_dt=1e-3))
    q = robot.q_home.copy()
    q[2] += 3.0
    plant.reset(q)
    hips = [robot.joint_names.index(name) for name in HIPS]
    told, found = np.zeros(robot.nj), []
    for k in range(50):
        told[hips] = speed if k < 5 else 0.0
        plant.step(velocity(told))
        found.append(plant.true_state().v[robot.base_dofs + hips[0]])
    return np.array(found)


@pytest.mark.parametrize("speed", [1.5, 6.0])
def test_a_joint_whose_servo_was_at_its_limit_comes_to_rest_as_in_the_finest_steps(
    get_robot, speed
):
    robot = get_robot("g1")
    ours, fine = jerked(robot, 1e-3, speed), jerked(robot, 5e-5, speed)
    assert np.abs(ours - fine).max() < 0.03 * speed
    assert np.abs(ours[20:]).max() < 0.1


def test_steps_are_divided_no_further_than_the_fastest_joint_needs(get_robot):
    parts = {
        name: Plant(get_robot(name), VELOCITY_TELEOP_PLANT)._servos.parts
        for name in ("g1", "biped20")
    }
    assert parts["biped20"] < parts["g1"] <= 16
    short = replace(VELOCITY_TELEOP_PLANT, physics_dt=5e-5)
    assert Plant(get_robot("g1"), short)._servos.parts == 1
    assert (
        Plant(get_robot("g1"), replace(VELOCITY_TELEOP_PLANT, actuation="torque"))._servos is None
    )


def test_a_divided_step_is_as_long_as_one_that_is_not(get_robot):
    robot = get_robot("g1")
    plant = Plant(robot, VELOCITY_TELEOP_PLANT)
    for _ in range(4):
        plant.step(velocity(np.full(robot.nj, 3.0)))
    assert plant.saturated.any()
    assert plant.data.time == pytest.approx(plant.time)
    assert plant.model.opt.timestep == VELOCITY_TELEOP_PLANT.physics_dt
