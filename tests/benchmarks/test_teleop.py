"""The recorded walk of the step teleoperator: on it a new controller commands the same."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.teleop import Replayed, Walk, record_walk
from poise.apps.teleoperation import run_teleop
from poise.errors import ConfigurationError
from poise.robots import load_robot


@pytest.fixture(scope="module")
def walk():
    return Walk.over_an_obstacle(load_robot("biped20"))


@pytest.fixture(scope="module")
def by_torque():
    return Walk.over_an_obstacle(load_robot("biped20"), "torque")


@pytest.fixture(scope="module")
def recorded(walk):
    """Until the right foot has left the ground."""
    return record_walk(walk, 400)


def test_the_recorded_walk_moves_the_robot_the_hands_and_the_load(walk, recorded):
    assert len(recorded) == 400
    period = walk.plant.control_dt
    np.testing.assert_allclose([t.state.time for t in recorded], period * np.arange(400))
    np.testing.assert_allclose([t.sample.time for t in recorded], period * np.arange(400))
    assert np.ptp([t.state.q for t in recorded], axis=0)[7:].max() > 0.1
    assert np.ptp([t.sample.place(1)[2] for t in recorded]) > 0.02
    right = list(walk.robot.soles)[1]
    load = np.array([t.state.contacts[right][2] for t in recorded])
    assert load[20] > 200.0
    assert load[-20:].max() < 1.0


def replayed(walk, recorded):
    """Commands of a new controller on a recording, and its leader."""
    teleoperator, commands = walk.teleoperator(), []
    controller = teleoperator.controller()
    teleoperator.device = Replayed(iter([tick.sample for tick in recorded]))
    for tick in recorded:
        estimate = teleoperator.estimator.update(tick.state)
        teleoperator.lead(estimate)
        commands.append(controller.step(estimate))
        teleoperator.estimator.command(commands[-1].acceleration, tick.state.time)
    return commands, teleoperator


def test_a_new_controller_on_the_recording_commands_what_it_did_in_the_simulation(walk, recorded):
    run = run_teleop(walk.robot, walk.script.device, walk.plant, duration=2.0, q_start=walk.q_start)
    commands, teleoperator = replayed(walk, recorded)
    np.testing.assert_array_equal([c.velocity for c in commands], run.log.command)
    assert teleoperator.mode.single


def test_steps_by_torque_are_told_what_they_commanded(by_torque):
    """As in the simulation, or the state that is carried on to now would be another one."""
    recorded = record_walk(by_torque, 60)
    walk = by_torque
    run = run_teleop(
        walk.robot, walk.script.device, walk.plant, duration=0.12, q_start=walk.q_start
    )
    commands, _ = replayed(walk, recorded)
    np.testing.assert_array_equal([c.torque for c in commands], run.log.command)


def test_a_biped_whose_legs_have_five_joints_is_refused_by_name():
    robot = load_robot("biped20")
    # A sole on the ankle: five joints above it.
    model = robot.model.copy()
    frame = model.frames[model.getFrameId(robot.roles["left_sole"].name)]
    frame.parentJoint = model.parents[frame.parentJoint]
    with pytest.raises(ConfigurationError, match="left_sole has too few joints"):
        Walk.over_an_obstacle(replace(robot, model=model))
