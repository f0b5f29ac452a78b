"""A robot whose joints take positions alone: servos pull with the torques that are commanded."""

from dataclasses import replace

import pytest

pytest.importorskip("mujoco")

from careful import careful_steps, trace

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.control import WholeBodyController
from poise.locomotion import ScriptedDevice, Walker, walking_stack
from poise.sim import Plant, PlantConfig, rollout

# Servos of humanoids, soft and stiff: of the torque limit for 1 rad and for 1 rad/s.
SOFT = PlantConfig.Servo(stiffness=5.0, damping=0.1)
STIFF = PlantConfig.Servo()


def position_plant(servo):
    return replace(TORQUE_TELEOP_PLANT, actuation="position", servo=servo).with_noise()


@pytest.mark.parametrize("servo", [SOFT, STIFF], ids=["soft", "stiff"])
def test_an_operator_steps_a_robot_of_position_servos(get_robot, servo):
    points, end = careful_steps(("left", 0.1, 0.0), ("right", 0.1, 0.0))
    run = run_teleop(
        get_robot("biped20"),
        lambda teleoperator: ScriptedDevice(points, *teleoperator.estimator.anchors),
        position_plant(servo),
        duration=end,
        seed=4,
    )
    assert not run.fell, trace(run)
    assert run.teleoperator.actuation == "torque"
    assert run.log.tilt.max() < 0.1
    # Both feet stand a step ahead.
    moved = [sole[0] for sole in run.teleoperator.estimator.anchors]
    assert min(moved) > 0.05, moved


def test_a_robot_of_position_servos_walks(get_robot):
    robot = get_robot("humanoid33")
    plant = Plant(robot, position_plant(STIFF), seed=4)
    walker = Walker(robot, walking_stack(robot))
    walker.set_velocity(0.3, 0.0, 0.0)
    controller = WholeBodyController(robot, walker.stack)
    for _ in rollout(plant, controller, walker, duration=6.0):
        assert not plant.fallen
    assert plant.com[0] > 1.0
