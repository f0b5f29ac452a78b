"""How runs end: a fall, a failed check, Ctrl-C, a kill, a solver without time; and what is left."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import poise_run

from poise.apps.scenarios import (
    parse_scenario,
    report,
    run_scenario,
    summarise,
    write_page,
    write_summary,
)
from poise.control import CommandStatus
from poise.errors import ConfigurationError, UnknownNameError
from poise.sim import RunRecord, read_log

STAND = """
name: stand still
robot: {robot}
duration: {duration}
stack:
  contacts:
    - surface: {{frame: left_sole}}
    - surface: {{frame: right_sole}}
  levels:
    - - com: {{kp: 60}}
      - frame: {{frame: pelvis, axes: orientation, kp: 100}}
    - - posture
"""

HARD_PUSH = "pushes: [{body: torso, at: 0.01, duration: 0.1, velocity_change: [3.0, 0.0, 0.0]}]\n"


def stand(duration=0.05, more="", robot="humanoid33"):
    return STAND.format(duration=duration, robot=robot) + more


def run(text, **options):
    return run_scenario(parse_scenario(text, "s.yaml"), **options)


def check(run, name):
    (found,) = [c for c in run.checks if c.name == name]
    return found


@pytest.fixture
def scenario_file(tmp_path):
    def write(text):
        path = tmp_path / "s.yaml"
        path.write_text(text)
        return str(path)

    return write


def test_a_run_has_one_tick_a_control_period_until_its_duration():
    done = run(stand(0.05, "plant: {control_dt: 0.002}"))
    assert done.ok
    assert len(done.signals.time) == 25
    assert done.signals.time[-1] == pytest.approx(0.05)
    assert done.ended_early == ""
    assert set(done.signals.status) == {"ok"}


def test_equal_scenarios_give_equal_runs_and_another_seed_another_one():
    noisy = "plant: {{sensors: {{joint_velocity_noise: 0.01}}}}\nseed: {}"
    a, b, c = (run(stand(0.02, noisy.format(seed))).signals.torque for seed in (1, 1, 2))
    assert (a == b).all()
    assert (a != c).any()


def test_a_payload_and_a_heavier_plant_are_the_plants_alone():
    more = "plant: {mass_scale: 1.1, payloads: [{frame: left_hand, mass: 5.0}]}"
    done = run(stand(0.01, more))
    weight = done.plant.model.body_subtreemass[1]
    assert weight == pytest.approx(1.1 * done.robot.mass + 5.0)
    assert done.controller.robot.mass == pytest.approx(100.0)


def test_the_height_of_a_sole_is_that_over_the_slope_below_it():
    signals = run(stand(0.005, "plant: {floor_slope: [0.1, 0.0]}")).signals
    assert set(signals.soles) == {"left_sole", "right_sole"}
    for sole in signals.soles.values():
        _, y, z = sole.position.T
        np.testing.assert_allclose(sole.height, z - y * np.tan(0.1), atol=1e-12)


def test_a_scenario_without_a_stack_stands_on_the_default_one():
    done = run("name: s\nduration: 0.02\n")
    assert done.ok
    assert next(t.name for _, t in done.controller.stack.tasks()) == "com"


def test_a_robot_that_stands_on_no_sole_runs_too(tmp_path):
    more = "stack:\n  levels:\n    - - posture\n"
    done = run(f"name: s\nduration: 0.02\nrobot: arm6\n{more}", log=tmp_path / "log.mcap")
    assert done.ok, done.checks
    page = write_page(done, summarise(done), tmp_path, None)
    assert page.stat().st_size > 100_000


def test_a_push_that_nobody_could_brake_ends_in_a_fall_and_a_report(tmp_path, scenario_file):
    # Ticks that find nothing feasible are slow: the cap keeps the fall short in wall-clock time.
    text = stand(4.0, HARD_PUSH + "controller: {time_limit: 0.002}\n")
    outcome = poise_run(tmp_path / "out", scenario_file(text), "--no-video")
    assert outcome.status == 1
    assert "ended early: the robot fell at" in outcome.err
    assert "FAIL  robot fell" in outcome.out
    assert outcome.summary["fell"] is True
    failed = {c["name"] for c in outcome.summary["checks"] if not c["ok"]}
    assert {"robot fell", "run ended early"} <= failed
    page = (outcome.folder / "report.html").read_text()
    assert "the robot fell at" in page
    fall = next(c for c in outcome.summary["checks"] if c["metric"] == "fell")
    assert fall["worst_time_s"] > 0.3
    assert " s)" in fall["mechanism"]
    assert fall["mechanism"] in outcome.out
    log = read_log(outcome.folder / "log.mcap")
    assert log.complete
    assert 0.3 < log.end < 4.0


def test_a_simulation_that_diverges_gives_a_report_too(tmp_path):
    push = "pushes: [{body: torso, at: 0.01, duration: 0.1, force: [1.0e+9, 0.0, 0.0]}]\n"
    done = run(stand(0.5, push, robot="biped20"))
    assert done.plant.diverged
    assert done.ended_early == "the simulation diverged"
    assert done.signals.time[-1] < 0.05
    assert len(done.record["base_estimate"]) == len(done.signals.time)
    assert not check(done, "run ended early").ok
    page = write_page(done, summarise(done), tmp_path, None)
    assert "the simulation diverged" in page.read_text()


def test_a_check_that_fails_fails_the_run():
    done = run(stand(0.02, "checks: [{metric: com_travel, at_least: 1.0}]"))
    assert not done.fell
    assert not done.ok
    assert [c.name for c in done.checks if not c.ok] == [
        "how far the COM moved, from least to most"
    ]


def test_a_check_says_when_it_was_worst_and_what_went_wrong_then():
    push = "pushes: [{body: torso, at: 0.1, duration: 0.1, velocity_change: [0.8, 0.0, 0.0]}]\n"
    bounds = "checks:\n  - {metric: zmp_margin_min, at_least: 0.03}\n"
    bounds += "  - {metric: com_error_max, until: 0.09, at_most: 0.01}\n"
    done = run(stand(0.4, push + bounds))
    margin, before = done.checks[-2:]
    assert not margin.ok
    assert (margin.metric, margin.relation, margin.unit) == ("zmp_margin_min", ">=", "m")
    worst = int(np.nanargmin(done.signals.zmp_margin))
    assert margin.time == pytest.approx(done.signals.time[worst])
    assert "ZMP at the edge of the feet" in margin.mechanism
    assert (before.ok, before.mechanism) == (True, "")


def test_a_check_that_could_not_be_measured_does_not_hold():
    done = run(stand(0.02, "checks: [{metric: com_travel, from: 0.0199, at_most: 1.0}]"))
    last = done.checks[-1]
    assert last.ok == (last.value == 0.0), "one tick is left in the window"
    more = "checks: [{metric: com_speed_end, from: 0.0199, at_most: 1.0}]"
    last = run(stand(0.02, more)).checks[-1]
    assert last.value != last.value
    assert not last.ok


def test_a_solver_without_time_counts_missed_ticks_and_raises_nothing(tmp_path):
    more = HARD_PUSH + "controller: {time_limit: 1e-9}\n"
    done = run(stand(0.3, more), log=tmp_path / "log.mcap")
    assert CommandStatus.TIME_LIMIT.value in done.signals.status
    summary = summarise(done)
    assert summary["missed_ticks"] == sum(s != "ok" for s in done.signals.status) > 0
    assert not check(done, "missed ticks").ok
    assert not done.ok
    json.dumps(summary, allow_nan=False)
    write_summary(summary, tmp_path)
    assert write_page(done, summary, tmp_path, None).is_file()


def interrupt_at(moment):
    """A progress that sends Ctrl-C to this process once the run is so far [s]."""
    sent = []

    def progress(done, _total):
        if done >= moment and not sent:
            sent.append(done)
            os.kill(os.getpid(), signal.SIGINT)

    return progress


def test_ctrl_c_ends_the_run_after_a_whole_tick_and_keeps_what_there_is(tmp_path):
    before = signal.getsignal(signal.SIGINT)
    done = run(stand(5.0), log=tmp_path / "log.mcap", progress=interrupt_at(0.05))
    assert signal.getsignal(signal.SIGINT) is before
    assert done.ended_early == "interrupted by the user"
    assert 0.05 <= done.signals.time[-1] < 0.2
    assert not check(done, "run ended early").ok
    assert not done.ok
    assert read_log(tmp_path / "log.mcap").complete
    summary = summarise(done)
    assert write_page(done, summary, tmp_path, None).is_file()


def test_ctrl_c_at_the_first_tick_still_gives_a_run():
    done = run(stand(5.0), progress=interrupt_at(0.0))
    assert len(done.signals.time) >= 1
    assert done.ended_early == "interrupted by the user"


def running(folder, *arguments):
    """A `poise run` in a process of its own that has got to half a second of its log."""
    command = [sys.executable, "-m", "poise", "run", *arguments, "--no-video"]
    process = subprocess.Popen(
        [*command, "--out", str(folder)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    log, deadline = folder / "log.mcap", time.monotonic() + 60.0
    while time.monotonic() < deadline:
        time.sleep(0.2)
        if log.is_file() and log.stat().st_size > 100 and read_log(log).end > 0.5:
            return process
    process.kill()
    raise AssertionError(f"the run did not get going: {process.communicate()}")


@pytest.mark.slow
def test_ctrl_c_in_a_terminal_leaves_summary_and_report(tmp_path, scenario_file):
    folder = tmp_path / "out"
    process = running(folder, scenario_file(stand(500.0)))
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert err == "ended early: interrupted by the user\n"
    assert json.loads((folder / "summary.json").read_text())["fell"] is False
    assert "interrupted by the user" in (folder / "report.html").read_text()
    assert read_log(folder / "log.mcap").complete


KILLED = """
import json, os, signal, sys, time
from pathlib import Path
from poise.apps.scenarios import load_scenario, run_scenario

reached = []

def progress(done, total):
    reached.append((time.monotonic(), done))
    if done > 0.5 and reached[-1][0] - reached[0][0] > 1.3:
        a_second_ago = max(d for t, d in reached if t <= reached[-1][0] - 1.0)
        print(json.dumps([a_second_ago, done]), flush=True)
        os.kill(os.getpid(), signal.SIGKILL)

run_scenario(load_scenario(sys.argv[1]), log=Path(sys.argv[2]), progress=progress)
"""


def test_a_killed_run_leaves_a_log_up_to_the_last_second(tmp_path, scenario_file):
    path = tmp_path / "log.mcap"
    command = [sys.executable, "-c", KILLED, scenario_file(stand(500.0)), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    a_second_ago, at_the_end = json.loads(done.stdout)
    log = read_log(path)
    assert not log.complete
    assert log.metadata["scenario"] == "stand still"
    assert a_second_ago <= log.end <= at_the_end + 0.01
    for name, size in (("q", 40), ("v", 39), ("com", 3), ("residuals", 4)):
        time, values = log.signal(name)
        assert values.shape == (len(time), size)
        assert time[-1] >= a_second_ago - 0.01


@pytest.mark.slow
def test_a_report_can_be_made_of_a_log_alone(tmp_path):
    log = tmp_path / "log.mcap"
    done = run_scenario(parse_scenario(stand(0.1), "stand.yaml"), log=log)
    page = report(log, tmp_path / "again").read_text()
    assert page == report(done.record, tmp_path / "memory", done.robot).read_text()
    for words in ("stand still", "whole_body", "tracking", "left_sole"):
        assert words in page


def test_a_scenario_is_run_by_its_name_or_file_and_paths_are_texts(scenario_file, tmp_path):
    log, folder = str(tmp_path / "log.mcap"), str(tmp_path / "page")
    done = run_scenario(scenario_file(stand(0.05)), log=log, progress=True)
    assert done.ok
    assert report(log, folder).parent == tmp_path / "page"
    with pytest.raises(UnknownNameError, match="neither a shipped scenario nor a file.*stand"):
        run_scenario("stnad")


def test_a_record_of_a_robot_from_a_file_says_how_to_give_it(scenario_file, tmp_path):
    page = tmp_path / "page"
    done = run_scenario(scenario_file(stand(0.05)))
    # As a robot from mona.urdf is called.
    done.record.metadata["robot"] = "mona"
    wanted = r"was made with a robot that is not in the catalog; got 'mona'.*robot=load_robot\(\"F"
    with pytest.raises(UnknownNameError, match="the record " + wanted):
        report(done.record, page)
    assert not page.exists()
    assert report(done.record, page, done.robot).is_file()


def test_a_record_of_no_rollout_is_not_reported(get_robot, tmp_path):
    record = RunRecord()
    record.add(0.0, {"hand_error": np.zeros(3)})
    for robot in (None, get_robot("biped20")):
        with pytest.raises(ConfigurationError, match="does not say its plant, tasks, levels"):
            report(record, tmp_path / "out", robot)
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(ConfigurationError, match="goes into a folder"):
        report(record, file)
