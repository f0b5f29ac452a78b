"""The recorded walk of the step teleoperator: on it a new controller commands the same."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.teleop import Replayed, Walk, record_walk
from poise.apps.teleoperation import run_teleop
from poise.errors import ConfigurationError
from poise.robots import load_robot


@pytest.mark.parametrize(("actuation", "ticks"), [("velocity", 400), ("torque", 60)])
def test_a_new_controller_on_the_recording_commands_what_it_did_in_the_simulation(actuation, ticks):
    walk = Walk.over_an_obstacle(load_robot("biped20"), actuation)
    recorded = record_walk(walk, ticks)
    teleoperator, commands = walk.teleoperator(), []
    controller = teleoperator.controller()
    teleoperator.device = Replayed(iter([tick.sample for tick in recorded]))
    for tick in recorded:
        estimate = teleoperator.estimator.update(tick.state)
        teleoperator.lead(estimate)
        commands.append(controller.step(estimate))
        teleoperator.estimator.command(commands[-1].acceleration, tick.state.time)
    duration = ticks * walk.plant.control_dt
    run = run_teleop(
        walk.robot, walk.script.device, walk.plant, duration=duration, q_start=walk.q_start
    )
    np.testing.assert_array_equal([getattr(c, actuation) for c in commands], run.log.command)
    right = list(walk.robot.soles)[1]
    assert recorded[20].state.contacts[right][2] > 0.0
    # By then the foot has left the ground.
    assert (recorded[-1].state.contacts[right][2] < 1.0) == teleoperator.mode.single


def test_a_biped_whose_legs_have_five_joints_is_refused_by_name():
    robot = load_robot("biped20")
    # A sole on the ankle: five joints above it.
    model = robot.model.copy()
    frame = model.frames[model.getFrameId(robot.roles["left_sole"].name)]
    frame.parentJoint = model.parents[frame.parentJoint]
    with pytest.raises(ConfigurationError, match="left_sole has too few joints"):
        Walk.over_an_obstacle(replace(robot, model=model))
