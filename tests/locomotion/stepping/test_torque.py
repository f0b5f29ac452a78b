"""The step teleoperator commands torques: the same leader, feet as contacts, feedback measured."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from slow import slow
from walker import up_and_down, walk

from poise.apps.teleoperation import (
    SCRIPTS,
    TORQUE_TELEOP_PLANT,
    BadOperator,
    replay_teleop,
    run_teleop,
)
from poise.control import (
    CommandStatus,
    OperationalSpaceController,
    ReducedController,
    WholeBodyController,
)
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import (
    ComDriver,
    Mode,
    ScriptedDevice,
    StepTeleoperator,
    TeleopParameters,
    teleop_parameters,
)
from poise.sim import Plant, SensorConfig, rollout


def test_what_is_commanded_and_by_whom_is_checked(get_robot):
    robot = get_robot("biped20")
    with pytest.raises(UnknownNameError, match=r"no such actuation.*'position'.*velocity, torque"):
        StepTeleoperator(robot, actuation="position")
    for actuation, name in (("torque", "differential_ik"), ("velocity", "osf")):
        with pytest.raises(UnknownNameError, match=f"no such controller.*by {actuation}.*{name}"):
            StepTeleoperator(robot, actuation=actuation, solved_by=name)
    driver = Mock(spec=ComDriver, omega=3.5)
    with pytest.raises(ConfigurationError, match="torques need the CoM shifter"):
        StepTeleoperator(robot, actuation="torque", driver=driver)
    with pytest.raises(ConfigurationError, match="different control periods"):
        walk(robot, up_and_down(), 1.0, plant=TORQUE_TELEOP_PLANT, parameters=TeleopParameters())


@pytest.mark.parametrize("actuation", ["torque", "velocity"])
def test_the_parameters_of_a_robot_are_what_it_is_led_by(get_robot, actuation):
    robot = get_robot("g1")
    made = teleop_parameters(robot, actuation)
    assert made == StepTeleoperator(robot, actuation=actuation).parameters
    q = robot.q_home.copy()
    q[2] -= 0.02
    # The base's height alone says nothing; a deeper squat has a lower CoM over the feet.
    assert teleop_parameters(robot, actuation, q_start=q) == made
    for side in ("left", "right"):
        for name, way in (("hip_pitch", -0.2), ("knee", 0.4), ("ankle_pitch", -0.2)):
            q[7 + robot.joint_index(f"{side}_{name}_joint")] += way
    bent = teleop_parameters(robot, actuation, q_start=q)
    assert bent.step_max < made.step_max
    assert bent == StepTeleoperator(robot, actuation=actuation, q_start=q).parameters
    with pytest.raises(UnknownNameError, match=r"no such actuation.*'position'"):
        teleop_parameters(robot, "position")


def test_a_solve_may_be_capped_where_the_controller_takes_that(get_robot):
    robot = get_robot("biped20")
    teleoperator = StepTeleoperator(robot)
    state = teleoperator.estimator.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    teleoperator.lead(state)
    capped = teleoperator.controller(time_limit=1.0).step(state)
    assert capped.status is CommandStatus.OK
    np.testing.assert_array_equal(capped.torque, teleoperator.controller().step(state).torque)
    with pytest.raises(ConfigurationError, match=r"time_limit is out of range; got 0.0"):
        teleoperator.controller(time_limit=0.0)
    for other in (
        StepTeleoperator(robot, solved_by="osf"),
        StepTeleoperator(robot, actuation="velocity"),
    ):
        with pytest.raises(ConfigurationError, match=r"takes no time_limit.*whole_body, reduced"):
            other.controller(time_limit=1e-3)


CONTROLLERS = {
    "whole_body": WholeBodyController,
    "reduced": ReducedController,
    "osf": OperationalSpaceController,
}


def first_torque(robot, name):
    """What a controller commands in the first tick."""
    teleoperator = StepTeleoperator(robot, actuation="torque", solved_by=name)
    controller = teleoperator.controller()
    assert isinstance(controller, CONTROLLERS[name or "whole_body"])
    state = teleoperator.estimator.update(teleoperator.estimator.dynamics.state)
    teleoperator.lead(state)
    command = controller.step(state)
    assert command.status.ok
    return command.torque


def test_each_controller_of_torques_solves_the_same_stack(get_robot):
    robot = get_robot("biped20")
    usual = first_torque(robot, None)
    np.testing.assert_allclose(first_torque(robot, "reduced"), usual, atol=1e-6)
    # It damps what it inverts, and looks for internal forces by itself.
    np.testing.assert_allclose(first_torque(robot, "osf"), usual, atol=0.01)


@pytest.mark.parametrize(
    ("name", "solved_by"),
    [
        ("g1", None), slow("biped20", None), slow("humanoid33", None),
        slow("g1", "reduced"), slow("g1", "osf"),
    ],
)  # fmt: skip
def test_a_foot_is_lifted_and_put_down(get_robot, name, solved_by, tmp_path):
    points, path = up_and_down(lift=0.1, lower=0.9), tmp_path / "x.mcap"
    options = {"plant": TORQUE_TELEOP_PLANT.with_noise(), "recording": path}
    run = walk(get_robot(name), points, 3.0, solved_by=solved_by, **options)
    log = run.log
    assert not run.fell
    assert log.tilt.max() < 0.1
    assert len(log.entries(Mode.SL)) == 1
    assert log.mode[-1] == list(Mode).index(Mode.D)
    assert log.soles[:, 1, 2].max() > 0.06
    assert abs(log.soles[-1, 1, 2]) < 0.003
    np.testing.assert_allclose(log.com[-1, :2], log.zmp_reference[-1], atol=0.01)
    if solved_by is not None:
        again = replay_teleop(path)
        assert again.teleoperator.solved_by == solved_by
        np.testing.assert_array_equal(again.log.command, log.command)


@pytest.mark.parametrize("slope", [slow((0.05, 0.0)), (0.0, 0.05), slow((0.0, -0.05))])
def test_g1_steps_on_a_floor_that_slopes_and_with_an_attitude_that_is_off(get_robot, slope):
    """3 degrees of slope and one of attitude; the velocity level falls standing still."""
    sensors = SensorConfig(base_orientation_error=(0.0175, 0.0175))
    plant = replace(TORQUE_TELEOP_PLANT, floor_slope=slope, sensors=sensors)
    run = walk(get_robot("g1"), up_and_down(lift=0.1, lower=0.9), 2.5, plant=plant)
    assert not run.fell
    assert len(run.log.entries(Mode.SL)) == 1
    assert run.log.tilt[-1] < 0.05


@pytest.mark.slow
def test_a_bad_operator_does_not_throw_g1_and_a_recording_is_the_same_again(get_robot, tmp_path):
    path = tmp_path / "take"
    run = run_teleop(
        get_robot("g1"),
        lambda teleoperator: BadOperator(teleoperator, 31),
        TORQUE_TELEOP_PLANT.with_noise(),
        duration=8.0,
        seed=31,
        recording=path,
    )
    assert not run.fell
    again = replay_teleop(path, get_robot("g1"))
    assert np.array_equal(again.log.command, run.log.command)


@pytest.mark.slow
def test_knees_stay_bent_where_a_straight_leg_would_be_singular(get_robot):
    """A straight knee cannot shorten the leg to first order: the trunk would bow for it."""
    robot = get_robot("g1")
    script = SCRIPTS["over_an_obstacle"](robot)
    teleoperator = StepTeleoperator(robot, q_start=script.posture(robot), actuation="torque")
    teleoperator.device = script.device(teleoperator)
    plant = Plant(robot, TORQUE_TELEOP_PLANT)
    plant.reset(script.posture(robot))
    knees = [robot.joint_index(name) for name in ("left_knee_joint", "right_knee_joint")]
    straightest = np.inf
    for tick in rollout(
        plant,
        teleoperator.controller(),
        teleoperator,
        estimator=teleoperator.estimator,
        duration=7.0,
    ):
        straightest = min(straightest, *tick.truth.q[7:][knees])
    assert straightest > 0.04
    assert not plant.fallen


def resting(teleoperator):
    return ScriptedDevice([], *teleoperator.estimator.anchors)


@pytest.mark.slow
def test_an_attitude_that_is_off_puts_the_com_no_farther_from_the_feet(get_robot):
    robot = get_robot("g1")
    sensors = replace(SensorConfig.typical(), base_orientation_error=(0.009, -0.006))
    run = run_teleop(robot, resting, replace(TORQUE_TELEOP_PLANT, sensors=sensors), duration=4.0)
    middles = [
        0.5 * sum(run.plant.data.site(name).xpos for name in run.teleoperator.soles),
        0.5 * sum(run.teleoperator.status.soles),
    ]
    true, ours = run.plant.com - middles[0], run.teleoperator.status.com - middles[1]
    # By the attitude alone it would be 6 and 4 mm off.
    assert np.abs(true - ours)[:2].max() < 2e-3
