"""A simulated robot behind a link: its drives, its sensors, and a controller that stands on it."""

import numpy as np
import pytest

import poise
from poise.errors import ConfigurationError
from poise.estimation import StateEstimator
from poise.hardware import LastCheck, LinkStatus, MotorCommand, PlantLink, TorqueSplit, robot_state

from poise.hardware import Action, Watchdog  # isort: skip

pytest.importorskip("mujoco")


@pytest.fixture
def robot(get_robot):
    return get_robot("biped20")


def make_link(robot, *, dt=0.002, period=None):
    check = LastCheck(robot, kp_max=500.0, kd_max=50.0)
    plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=dt))
    return plant, check, PlantLink(plant, check, period=period)


def stand(robot, link, split, seconds, watchdog=None):
    """Stand under control from what the link measures, and return the verdicts."""
    controller, estimator = poise.WholeBodyController(robot), StateEstimator(robot)
    com = next(
        t for level in controller.stack.levels for t in level if isinstance(t, poise.ComTask)
    )
    home, verdicts = poise.Dynamics(robot).com.copy(), []
    while link.clock() < seconds:
        measured = link.read()
        command = controller.step(estimator.update(robot_state(robot, link.info, measured)))
        com.set_target(home + [0.0, 0.02 * np.sin(3.0 * link.clock()), 0.0])
        if watchdog is not None:
            verdicts.append(watchdog.evaluate(link, measured, command))
        link.write(split.split(command, measured))
    return verdicts


def test_torque_alone_is_the_same_as_the_plants_own(robot):
    plant, _, link = make_link(robot)
    twin = poise.Plant(robot, plant.config)
    torque = 0.1 * robot.tau_max
    zero = np.zeros(robot.nj)
    for _ in range(20):
        link.write(MotorCommand(q=zero, dq=zero, kp=zero, kd=zero, tau=torque))
        twin.step(poise.Command(poise.CommandStatus.OK, torque))
    assert plant.state().q.tolist() == twin.state().q.tolist()
    assert link.clock() == twin.time


def test_drives_act_at_the_rate_of_the_plant(robot):
    """Stiff drives at 1 kHz hold the posture of a robot whose commands come at 100 Hz."""
    plant, _, link = make_link(robot, dt=0.001, period=0.01)
    assert link.info.rate == 100.0
    zero, ones = np.zeros(robot.nj), np.ones(robot.nj)
    home = robot.q_home[-robot.nj :]
    held = MotorCommand(q=home, dq=zero, kp=400.0 * ones, kd=10.0 * ones, tau=zero)
    for _ in range(30):
        link.write(held)
    assert link.status is LinkStatus.OK
    assert plant.time == pytest.approx(0.3)
    assert np.abs(plant.state().q[-robot.nj :] - home).max() < 0.1


def test_a_robot_stands_and_sways_by_torques_with_low_gains(robot):
    plant, check, link = make_link(robot)
    split = TorqueSplit(check, kp=20.0, kd=1.0)
    verdicts = stand(robot, link, split, 1.5, Watchdog(robot))
    assert not plant.fallen
    assert (link.refused, link.reason, link.status) == (0, "", LinkStatus.OK)
    assert {v.response for v in verdicts} == {Action.RUN}, verdicts[-1]
    assert np.abs(plant.state().v[6:]).max() > 0.01


def test_refused_commands_damp_and_are_counted(robot):
    plant, check, link = make_link(robot)
    bad = MotorCommand.damping(np.full(robot.nj, np.nan))
    link.write(bad)
    assert (link.status, link.refused) == (LinkStatus.REFUSED, 1)
    assert "kd of " in link.reason
    assert np.isfinite(plant.state().q).all()
    link.write(check.damping)
    assert (link.status, link.refused) == (LinkStatus.OK, 1)


def test_what_is_read_is_what_the_plant_measures(robot):
    plant, _, link = make_link(robot)
    link.write(MotorCommand.damping(np.ones(robot.nj)))
    state, raw = link.read(), plant.state()
    again = robot_state(robot, link.info, state)
    assert again.q[3:].tolist() == raw.q[3:].tolist()
    assert again.v[3:].tolist() == raw.v[3:].tolist()
    assert again.time == state.time == state.arrived == plant.time
    assert set(again.contacts) == set(robot.soles)
    for sole, wrench in raw.contacts.items():
        assert again.contacts[sole].tolist() == wrench.tolist()
    for mine, theirs in zip(again.readings, raw.readings, strict=True):
        assert mine.tolist() == theirs.tolist()


def test_nothing_moves_after_close(robot):
    plant, check, link = make_link(robot)
    link.close()
    time = plant.time
    link.write(check.damping)
    assert (plant.time, link.status) == (time, LinkStatus.LOST)


def test_a_plant_that_does_not_fit_is_refused(robot, get_robot):
    plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002))
    check = LastCheck(robot, kp_max=0.0, kd_max=50.0)
    with pytest.raises(ConfigurationError, match="multiple"):
        PlantLink(plant, check, period=0.003)
    with pytest.raises(ConfigurationError, match="other joints"):
        PlantLink(plant, LastCheck(get_robot("humanoid33"), kp_max=0.0, kd_max=50.0))
