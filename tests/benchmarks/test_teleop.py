"""The benchmark of the step teleoperator: what is timed is the walk, and the result is complete."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.teleop import (
    WARM_UP,
    StepTimes,
    TeleopBench,
    TeleopResult,
    Walk,
    bench_teleop,
    format_teleop_table,
    record_walk,
    time_steps,
)
from poise.apps.teleoperation import run_teleop
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import load_robot

KEYS = {
    "robot", "joints", "controller", "actuation", "scenario", "period_us", "p50_us", "p99_us",
    "max_us", "estimator_us", "leader_us", "controller_us", "share_of_period", "ticks",
    "single_support", "missed_ticks", "simulated_s", "real_time_factor", "real_time_factor_cpu",
    "simulation_p50_us",
}  # fmt: skip


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


def test_a_new_controller_on_the_recording_commands_what_it_did_in_the_simulation(walk, recorded):
    run = run_teleop(walk.robot, walk.script.device, walk.plant, duration=2.0, q_start=walk.q_start)
    teleoperator = walk.teleoperator()
    teleoperator.device = walk.script.device(teleoperator)
    controller, commands = teleoperator.controller(), []
    for tick in recorded:
        estimate = teleoperator.estimator.update(tick.state)
        teleoperator.lead(estimate)
        commands.append(controller.step(estimate).velocity)
    np.testing.assert_array_equal(commands, run.log.command)
    assert teleoperator.mode.single


def test_steps_by_torque_are_told_what_they_commanded(by_torque):
    """As in the simulation, or the state that is carried on to now would be another one."""
    recorded = record_walk(by_torque, 60)
    walk = by_torque
    run = run_teleop(
        walk.robot, walk.script.device, walk.plant, duration=0.12, q_start=walk.q_start
    )
    commands = time_steps(walk, recorded).commands
    np.testing.assert_array_equal([c.torque for c in commands], run.log.command)


def test_an_actuation_that_nobody_has_is_refused():
    with pytest.raises(UnknownNameError, match=r"'position'.*torque, velocity"):
        TeleopBench(actuation="position")


def test_every_step_is_timed_and_known_to_stand_on_one_foot_or_two(walk, recorded):
    times = time_steps(walk, recorded)
    assert isinstance(times, StepTimes)
    assert (times.seconds > 0.0).all()
    assert len(times.seconds) == len(times.single) == len(times.missed) == 400
    assert not times.single[0]
    assert times.single[-1]
    assert not any(times.missed)


@pytest.mark.parametrize(("actuation", "period"), [("torque", 2e-3), ("velocity", 5e-3)])
def test_the_result_is_complete_and_counts_what_follows_the_warm_up(actuation, period):
    seen, plan = [], TeleopBench(ticks=25, actuation=actuation)
    (result,) = bench_teleop(plan, lambda done, total: seen.append((done, total)))
    assert set(result.to_json()) == KEYS
    assert (result.robot, result.joints, result.controller) == ("biped20", 20, "teleop")
    assert (result.actuation, result.scenario) == (actuation, "over_an_obstacle")
    assert (result.period_us, result.ticks) == (1e6 * period, 25)
    assert result.simulated_s == pytest.approx((25 + WARM_UP) * period)
    parts = result.estimator_us, result.leader_us, result.controller_us
    assert min(parts) > 0.0
    assert sum(parts) == pytest.approx(result.p50_us, rel=0.3)
    assert 0.0 < result.p50_us <= result.p99_us <= result.max_us
    assert result.share_of_period == pytest.approx(result.p50_us * 1e-6 / period, abs=1e-4)
    assert result.real_time_factor > 0.0
    assert result.real_time_factor_cpu > 0.0
    assert result.simulation_p50_us > 0.0
    assert (result.single_support, result.missed_ticks) == (0.0, 0)
    assert seen[-1][0] == seen[-1][1]


def test_more_ticks_than_the_walk_has_take_further_passes(monkeypatch):
    # A walk of 45 ticks leaves 15 a pass.
    monkeypatch.setattr(Walk, "ticks", property(lambda _: WARM_UP + 15))
    (result,) = bench_teleop(TeleopBench(ticks=40))
    assert result.ticks == 40
    assert result.simulated_s == pytest.approx((WARM_UP + 15) * 2e-3)
    (result,) = bench_teleop(TeleopBench())
    assert result.ticks == 15


def test_a_biped_whose_legs_have_five_joints_is_refused_by_name():
    robot = load_robot("biped20")
    # A sole on the ankle: five joints above it.
    model = robot.model.copy()
    frame = model.frames[model.getFrameId(robot.roles["left_sole"].name)]
    frame.parentJoint = model.parents[frame.parentJoint]
    with pytest.raises(ConfigurationError, match="left_sole has too few joints"):
        Walk.over_an_obstacle(replace(robot, model=model))


def test_the_table_has_a_line_a_robot_and_marks_failures():
    result = TeleopResult(
        robot="biped20",
        joints=20,
        controller="teleop",
        actuation="velocity",
        scenario="over_an_obstacle",
        period_us=5000.0,
        p50_us=250.0,
        p99_us=400.0,
        max_us=900.0,
        estimator_us=60.0,
        leader_us=120.0,
        controller_us=70.0,
        share_of_period=0.05,
        ticks=2770,
        single_support=0.69,
        missed_ticks=0,
        simulated_s=14.0,
        real_time_factor=3.9,
        real_time_factor_cpu=6.5,
        simulation_p50_us=300.0,
    )
    broken = replace(result, robot="g1", missed_ticks=3)
    lines = format_teleop_table([result, broken]).splitlines()
    assert "over_an_obstacle" in lines[0]
    assert "T = 5 ms" in lines[0]
    cells = "biped20 250 400 900 60 120 70 5.0 300 x"
    assert lines[2].split()[:10] == cells.split()
    assert lines[2].endswith("6.5  20 joints, 2770 ticks, 69% on one foot")
    assert lines[3].endswith(", 3 FAILED")


def test_the_command_prints_one_json_object_and_writes_it(tmp_path, capsys):
    arguments = ["teleop", "--ticks", "5"]
    assert main([*arguments, "--json", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    (line,) = printed.splitlines()
    assert set(json.loads(line)) == KEYS
    assert (tmp_path / "bench.json").read_text(encoding="utf-8") == printed
