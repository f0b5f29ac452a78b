"""`python -m benchmarks tick`: what it prints is complete, plausible and about moving states."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.clocked import Subject
from benchmarks.methods import parse_method, timed_methods
from benchmarks.recording import Recording, bench_stack
from benchmarks.result import PHASES, TickResult, format_table
from poise.control import WholeBodyController
from poise.dynamics import RobotState
from poise.robots import load_robot

KEYS = {
    "robot",
    "joints",
    "controller",
    "solver",
    "stack",
    "contacts",
    "schedule",
    "variables",
    "rows",
    "p50_us",
    "p99_us",
    "max_us",
    "cpu_min_us",
    "cpu_p10_us",
    "cpu_p50_us",
    "cpu_p99_us",
    "phases_us",
    "ticks",
    "residual_max",
    "ratio_to_direct",
    "ratio_to_whole",
    "relaxed_ticks",
    "missed_ticks",
}


def bench_in_a_process(*arguments: str) -> str:
    """What the command prints, without the tests' shape checks, which slow every phase."""
    command = [sys.executable, "-m", "benchmarks", "tick", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.mark.slow
def test_a_line_a_method_and_stack_with_every_key_and_files_in_out(tmp_path):
    methods = "direct,cascade/osqp"
    text = bench_in_a_process(
        "--ticks", "30", "--json", "--out", str(tmp_path), "--methods", methods
    )
    rows = [json.loads(line) for line in text.splitlines()]
    assert [(r["stack"], r["solver"]) for r in rows] == [
        ("table1", "direct"),
        ("table1", "cascade/osqp"),
        ("default", "direct"),
        ("default", "cascade/osqp"),
    ]
    for row in rows:
        assert set(row) == KEYS
        assert set(row["phases_us"]) == set(PHASES)
        assert (row["robot"], row["joints"], row["contacts"]) == ("humanoid33", 33, "double")
        assert row["ticks"] == 30
        assert row["missed_ticks"] == 0
        assert 0.0 < row["p50_us"] <= row["p99_us"] <= row["max_us"]
        assert row["ratio_to_direct"] > 0.0
        assert row["ratio_to_whole"] == 1.0
        assert 0.0 < row["cpu_min_us"] <= row["cpu_p10_us"]
        assert row["cpu_p10_us"] <= row["cpu_p50_us"] <= row["cpu_p99_us"]
        assert 0.0 <= row["residual_max"] < 1e-3
        assert sum(row["phases_us"].values()) == pytest.approx(row["p50_us"], rel=0.3)
    assert [r["ratio_to_direct"] for r in rows[::2]] == [1.0, 1.0]
    assert (tmp_path / "bench.json").read_text(encoding="utf-8") == text


def test_the_table_of_the_paper_has_its_variables_and_rows():
    robot = load_robot("humanoid33")
    for stance, contacts, effectors in (("double", 2, 2), ("single", 1, 3)):
        result = size_of(robot, stance)
        # Table 1 of the paper: n + 6 + 6 c variables; base dynamics, torque limits, contacts,
        # cones, acceleration limits, COM, pelvis, end effectors. One bound a normal force more.
        n = robot.nj
        rows = 6 + n + 6 * contacts + 10 * contacts + n + 3 + 3 + 6 * effectors + contacts
        assert result == (n + 6 + 6 * contacts, rows)


def size_of(robot, stance):
    controller = WholeBodyController(robot, bench_stack(robot, "table1", stance))
    controller.step(RobotState(robot.q_home, np.zeros(robot.nv)))
    problem = controller.strategy.current.full.problem
    bounded = np.isfinite(problem.x_lower) | np.isfinite(problem.x_upper)
    return problem.n, problem.m + int(bounded.sum())


def test_the_recorded_states_move_and_every_one_differs(recording: Recording):
    v = np.array([state.v for state in recording.states])
    assert (np.abs(v).max(axis=1) > 0.1).all()
    q = np.array([state.q for state in recording.states])
    assert (np.abs(np.diff(q, axis=0)).max(axis=1) > 1e-5).all()


def test_the_recorded_targets_are_those_of_the_run(recording):
    subject = Subject(recording, "default", parse_method("whole_body", "direct"))
    for tick in range(len(recording.states)):
        subject.tick(tick)
    stack = subject.controller.stack
    assert np.linalg.norm(stack.task("com").error) < 1e-3
    assert np.linalg.norm(stack.task("left_hand pose").error) < 1e-2


def test_the_phases_add_up_to_the_tick(recording):
    subject = Subject(recording, "table1", parse_method("whole_body", "direct"))
    for tick in range(len(recording.states)):
        subject.tick(tick)
    times = subject.times(slice(10, None))
    parts = times.phases.sum(axis=1)
    assert (parts <= times.total).all()
    # What is left is the check of the state, which the tests' own shape checks make slower.
    assert np.median(parts / times.total) > 0.7


@pytest.mark.slow
def test_single_support_stands_on_the_right_foot_with_the_left_one_moving():
    text = bench_in_a_process(
        "--contacts", "single", "--ticks", "20", "--json", "--methods", "direct"
    )
    rows = [json.loads(line) for line in text.splitlines()]
    assert [(r["stack"], r["contacts"]) for r in rows] == [
        ("table1", "single"),
        ("default", "single"),
    ]
    for row in rows:
        assert row["variables"] == 33 + 6 + 6
        assert row["missed_ticks"] == 0
        assert row["residual_max"] < 1e-6


def test_the_table_has_a_line_a_method_and_marks_failures():
    row = TickResult(
        robot="humanoid33",
        joints=33,
        controller="whole_body",
        solver="direct",
        stack="table1",
        contacts="double",
        schedule="tick",
        variables=51,
        rows=124,
        p50_us=100.0,
        p99_us=120.0,
        max_us=150.0,
        cpu_min_us=97.0,
        cpu_p10_us=98.0,
        cpu_p50_us=99.0,
        cpu_p99_us=119.0,
        phases_us=dict.fromkeys(PHASES, 25.0),
        ticks=10,
        residual_max=1e-15,
        ratio_to_direct=1.0,
        ratio_to_whole=1.0,
        relaxed_ticks=0,
        missed_ticks=0,
    )
    reduced = replace(row, controller="reduced", ratio_to_whole=0.5)
    peer = replace(
        row,
        controller="tsid",
        solver="peer",
        schedule="batch",
        missed_ticks=3,
        residual_max=None,
        ratio_to_whole=None,
        cpu_p10_us=None,
        cpu_p99_us=None,
        phases_us=dict.fromkeys(PHASES, None),
    )
    lines = format_table([row, reduced, peer]).splitlines()
    assert lines[0].startswith("humanoid33, 33 joints, double support, stack 'table1'")
    assert lines[2].split()[:4] == ["whole_body", "direct", "100", "120"]
    assert lines[3].split()[:2] == ["reduced", "direct"]
    assert lines[3].split()[11:13] == ["1.00", "0.50"]
    assert lines[4].startswith("peer, in batches")
    assert lines[4].split()[6:11] == ["-"] * 5
    assert lines[4].endswith("3 of 10 ticks FAILED")
    assert "FAILED" not in lines[2]


def test_the_reduced_controller_stands_beside_the_full_one_method_by_method():
    names = [(m.controller, m.name) for m in timed_methods("reduced", None)]
    assert names == [
        ("whole_body", "direct"),
        ("whole_body", "cascade/osqp"),
        ("reduced", "direct"),
        ("reduced", "cascade/osqp"),
    ]
