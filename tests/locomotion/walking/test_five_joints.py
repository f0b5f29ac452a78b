"""Walks in MuJoCo on legs of five joints: soles that lean with their legs, or do not turn."""

import math

import pytest

import poise
from poise.errors import ConfigurationError
from poise.locomotion import (
    Gait,
    Stride,
    Walker,
    plan_footsteps,
    walking_stack,
)

sim = pytest.importorskip("poise.sim")

ROLL, YAW = ".*_ankle_roll", ".*_hip_yaw"
LEGS = [(ROLL, 0.14), (ROLL, 0.05), (YAW, 0.14)]


def walked(robot, walker, stack, duration, lead=lambda time: None):
    """Largest error of the divergent component along the way, and the plant at its end."""
    plant = sim.Plant(robot, sim.PlantConfig(control_dt=0.002))
    controller, error = poise.WholeBodyController(robot, stack), 0.0
    for tick in poise.rollout(plant, controller, walker, duration=duration):
        lead(tick.time)
        assert tick.command.status.ok
        error = max(error, math.hypot(*walker.dcm_error))
    assert not plant.fallen
    return error, plant


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(("joints", "width"), LEGS)
def test_they_walk_a_plan(get_robot_without, joints, width):
    robot = get_robot_without(joints, width=width)
    stack = walking_stack(robot)
    gait = Gait(step_time=0.6, crouch=0.02, shift_time=0.8, settle_time=1.0)
    plan = plan_footsteps(robot, [Stride(steps=6, length=0.12)], gait)
    walker = Walker(robot, stack, plan=plan)
    error, plant = walked(robot, walker, stack, plan.duration + 0.1)
    assert (walker.status.value, walker.steps_made) == ("standing", 7)
    assert error < 0.08
    assert plant.com[0] > 0.6


@pytest.mark.slow
@pytest.mark.parametrize(("joints", "width"), LEGS)
def test_they_are_led_ahead_and_to_the_side(get_robot_without, joints, width):
    robot = get_robot_without(joints, width=width)
    stack = walking_stack(robot)
    walker = Walker(robot, stack)

    def lead(time):
        asked = (0.3, 0.0) if 0.5 < time < 3.0 else (0.0, 0.15) if 3.0 < time < 5.5 else (0.0, 0.0)
        walker.set_velocity(*asked)

    error, plant = walked(robot, walker, stack, 8.0, lead)
    assert walker.status.value == "standing"
    assert error < 0.1
    assert plant.com[0] > 0.45
    assert plant.com[1] > 0.15


def test_legs_without_yaw_do_not_turn(get_robot_without):
    robot = get_robot_without(YAW)
    walker = Walker(robot, walking_stack(robot))
    walker.set_velocity(0.2, 0.0, 0.3)
    assert "taken to (0.20 m/s, 0.00 m/s, 0.00 rad/s)" in walker.notice
    plan = plan_footsteps(robot, [Stride(steps=4, length=0.1, turn=0.1)])
    with pytest.raises(ConfigurationError, match="out of reach") as caught:
        Walker(robot, walking_stack(robot), plan=plan)
    assert "rad aside" in str(caught.value)


def test_where_soles_lean_hands_and_torso_weigh_as_much_as_the_com(get_robot, get_robot_without):
    def weights(robot):
        stack = walking_stack(robot)
        stack.bind(robot)
        balance, _ = stack.levels
        return {task.name: task.weight.max() for task in balance}

    whole, leaning = weights(get_robot("humanoid33")), weights(get_robot_without(ROLL))
    upper = {"pelvis", "torso", "left_hand", "right_hand"}
    assert whole.keys() == leaning.keys() == {"com", "left_foot", "right_foot"} | upper
    assert {leaning[name] for name in upper} == {leaning["com"]} == {whole["com"]}
    assert max(whole[name] for name in upper) < 0.1 * whole["com"]
