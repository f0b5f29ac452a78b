"""Where the controller thinks the robot is, against the simulator, and what it never reads."""

from dataclasses import replace

import numpy as np
import pytest
from walker import hands, up_and_down, walk

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, VELOCITY_TELEOP_PLANT
from poise.control import CommandStatus
from poise.dynamics import RobotState
from poise.locomotion import Mode, StepTeleoperator
from poise.sim import Plant, SensorConfig, rollout


@pytest.mark.parametrize(
    ("plant", "off"),
    [(VELOCITY_TELEOP_PLANT, 5e-3), (VELOCITY_TELEOP_PLANT.with_noise(), 1e-2)],
    ids=["exact", "noise"],
)
def test_soles_and_com_are_where_the_simulator_has_them(get_robot, plant, off):
    robot = get_robot("biped20")
    run = walk(robot, up_and_down(lift=0.1, lower=1.0), 2.4, plant=plant, seed=3)
    assert run.log.when(Mode.SL).any()
    status, data = run.teleoperator.status, run.plant.data
    for name, ours in zip(run.teleoperator.soles, status.soles, strict=True):
        assert np.abs(data.site(name).xpos - ours).max() < off
    assert np.abs(run.plant.com - status.com).max() < off


@pytest.mark.parametrize("garbage", [1e4, np.nan], ids=["far away", "nan"])
def test_position_and_velocity_of_the_base_are_never_read(get_robot, garbage):
    robot = get_robot("biped20")
    commands = []
    for spoil in (False, True):
        plant = Plant(robot, VELOCITY_TELEOP_PLANT)
        teleoperator = StepTeleoperator(robot, actuation="velocity")
        teleoperator.device = hands(*up_and_down(lift=0.1))(teleoperator)
        controller = teleoperator.controller()
        for _ in range(160):
            state = plant.state()
            if spoil:
                q, v = state.q.copy(), state.v.copy()
                q[:3], v[:3] = garbage, garbage
                state = RobotState(q, v, state.contacts, state.time)
            estimate = teleoperator.estimator.update(state)
            teleoperator.lead(estimate)
            command = controller.step(estimate)
            commands.append(command.velocity)
            plant.step(command)
    half = len(commands) // 2
    assert np.array_equal(commands[:half], commands[half:])


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("foot", [0, 1])
def test_a_base_that_spins_turns_about_the_sole_at_rest(get_robot, foot, axis):
    robot = get_robot("biped20")
    ours = StepTeleoperator(robot, actuation="velocity").estimator
    ours.stand_on(foot)
    v = np.zeros(robot.nv)
    v[3 + axis] = 0.4
    ours.update(RobotState(robot.q_home, v))
    sole = ours.dynamics.frame(robot.frame_id(list(robot.soles)[foot])).velocity
    assert sole[:3] == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(sole[3:]) == pytest.approx(0.4)


@pytest.mark.parametrize("time", [0.005, np.nan])
def test_a_state_that_cannot_be_used_is_passed_over_and_the_command_fades(get_robot, time):
    robot = get_robot("biped20")
    teleoperator = StepTeleoperator(robot, actuation="velocity")
    teleoperator.device = hands(*up_and_down())(teleoperator)
    controller = teleoperator.controller()

    def step(state):
        estimate = teleoperator.estimator.update(state)
        teleoperator.lead(estimate)
        return controller.step(estimate)

    good = step(RobotState(robot.q_home, np.zeros(robot.nv)))
    status = teleoperator.status
    speeds = [np.abs(good.velocity).max()]
    for _ in range(200):
        bad = step(RobotState(np.full(robot.nq, np.nan), np.zeros(robot.nv), time=time))
        assert bad.status is CommandStatus.BAD_STATE
        speeds.append(np.abs(bad.velocity).max())
    assert (np.diff(speeds) <= 0.0).all()
    assert speeds[-1] < 0.05 * speeds[0] + 1e-12
    assert teleoperator.status is status


def test_the_floor_may_slope_a_little(get_robot):
    plant = replace(VELOCITY_TELEOP_PLANT, floor_slope=(0.0, 0.01))
    run = walk(get_robot("biped20"), up_and_down(lift=0.1, lower=1.0), 2.6, plant=plant)
    assert run.log.when(Mode.SL).any()
    assert not run.fell


def test_late_sensors_are_made_up_for(get_robot):
    """Where torques are commanded; told nothing of the commands, velocities stay late."""
    robot, off = get_robot("biped20"), []
    for told in (True, False):
        late = replace(TORQUE_TELEOP_PLANT, sensors=SensorConfig(delay=0.01))
        plant = Plant(robot, late)
        teleoperator = StepTeleoperator(robot, actuation="torque")
        teleoperator.device = hands(*up_and_down(lift=0.1))(teleoperator)
        estimator = teleoperator.estimator
        ticks = rollout(
            plant,
            teleoperator.controller(),
            teleoperator,
            estimator=estimator if told else estimator.update,
            duration=1.0,
        )
        truth = [plant.true_state()]
        errors = []
        for tick in ticks:
            errors.append(tick.estimate.v[6:] - truth[-1].v[6:])
            truth.append(tick.truth)
        off.append(float(np.sqrt(np.mean(np.square(errors[50:])))))
        assert tick.estimate.time == pytest.approx(tick.time - (0.0 if told else 0.01))
    # Half of what is commanded counts, all of which this robot does.
    assert off[0] < 0.6 * off[1]
