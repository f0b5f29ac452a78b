"""Scenarios on a robot behind a link, in the time of a simulated one."""

from dataclasses import replace

import numpy as np
import pytest

import poise
from poise.apps import deployment
from poise.apps.scenarios import load_scenario
from poise.errors import ConfigurationError, PoiseError
from poise.hardware import LastCheck, PlantLink, TorqueSplit
from poise.sim import HoistedPlant, PlantConfig, read_log


def make(get_robot, name="biped20", **config):
    robot = get_robot(name)
    plant = HoistedPlant(robot, PlantConfig(control_dt=0.002, **config).with_noise())
    check = LastCheck(robot, kp_max=robot.tau_max, kd_max=robot.tau_max / robot.v_max)
    split = TorqueSplit(check, kp=0.1 * check.kp_max, kd=0.1 * check.kd_max)
    return robot, plant, PlantLink(plant, load_cells=False), check, split


def standing(robot, seconds=0.5, **changes):
    scenario = replace(load_scenario("squat"), robot=robot.name, motions=(), checks=())
    return replace(scenario, duration=seconds, **changes)


@pytest.fixture(scope="module")
def deployed(get_robot, tmp_path_factory):
    """A robot that was brought into its posture, stood, and was damped; its run and log."""
    robot, plant, link, check, split = make(get_robot)
    log = tmp_path_factory.mktemp("deployed") / "log.mcap"
    scenario = standing(robot)
    stage = deployment.stage_deployment(scenario, robot, link, check, split)
    run = deployment.deploy(stage, log=log)
    return robot, plant, check, split, scenario, run, log


def test_a_scenario_holds_on_a_robot_behind_a_link_without_load_cells(deployed):
    _, _, _, _, _, run, _ = deployed
    assert run.ok, run.ended_early
    assert run.ended_early == ""


def test_states_as_received_and_commands_as_sent_are_in_the_log(deployed):
    robot, _, check, _, _, _, log = deployed
    record = read_log(log)
    times, tau = record.signal("sent/tau")
    assert tau.shape == (len(times), robot.nj)
    assert len(record["received/q"]) == len(record["age"]) == len(times)
    assert np.all(np.diff(record["received/time"]) > 0.0)
    assert np.abs(tau).max() <= robot.tau_max.max()
    assert {text for _, text in record.notes("link")} == {"ok"}
    assert record.complete
    end = read_log(log.with_stem("log_end"))
    assert end["sent/kd"][-1] == pytest.approx(check.damping.kd, rel=0.05)
    assert np.abs(end["sent/tau"][-1]).max() < 0.05 * robot.tau_max.max()


def test_replayed_states_give_the_commands_that_were_sent(deployed):
    robot, _, check, split, scenario, _, log = deployed
    again = deployment.replay_states(log, scenario, robot, check, split)
    assert len(again.time) > 1000
    assert again.difference.max() < 1e-3
    weak = TorqueSplit(check, kp=0.0, kd=0.0)
    other = deployment.replay_states(log, scenario, robot, check, weak)
    assert other.difference.max() > 10.0 * again.difference.max()


def test_a_log_without_states_cannot_be_replayed(get_robot, tmp_path):
    robot, plant, _, check, _ = make(get_robot)
    path = tmp_path / "other.mcap"
    recorder = poise.Recorder(path)
    recorder.begin(plant)
    recorder.look()
    recorder.end()
    with pytest.raises(PoiseError, match="no states of a robot"):
        deployment.replay_states(path, standing(robot), robot, check)


def test_a_scenario_that_commands_velocities_is_refused(get_robot):
    robot, _, link, check, _ = make(get_robot)
    scenario = replace(load_scenario("over_an_obstacle_velocity"), robot=robot.name)
    with pytest.raises(ConfigurationError, match="control period|commands velocities"):
        deployment.stage_deployment(scenario, robot, link, check)


def test_a_stopped_robot_is_damped_and_the_run_says_why(get_robot):
    robot, _, link, check, split = make(get_robot)
    stage = deployment.stage_deployment(standing(robot), robot, link, check, split)
    body = stage.plant.body
    body.watchdog.stop()
    run = deployment.deploy(stage)
    assert run.fell
    assert "emergency stop" in run.ended_early
    assert body.sent is None


def test_orders_that_need_a_simulator_are_refused(get_robot):
    robot, _, link, check, split = make(get_robot)
    stage = deployment.stage_deployment(standing(robot), robot, link, check, split)
    with pytest.raises(ConfigurationError, match="cannot be pushed"):
        stage.plant.push(robot.torso, (1.0, 0.0, 0.0), 0.1)
