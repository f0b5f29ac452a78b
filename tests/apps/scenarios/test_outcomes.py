"""How runs end: a fall, a failed check, Ctrl-C, a kill, a solver without time; and what is left."""

import json
import os
import signal
import subprocess
import sys

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
from poise.errors import ConfigurationError
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
