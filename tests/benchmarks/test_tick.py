"""`python -m benchmarks tick`: what it prints is complete, plausible and about moving states."""

import json
import subprocess
import sys

import numpy as np
import pytest
from tick_results import tick_result

from benchmarks.recording import bench_stack
from benchmarks.result import PHASES, format_table
from poise.control import WholeBodyController
from poise.dynamics import RobotState
from poise.robots import load_robot


@pytest.mark.slow
def test_a_line_a_method_and_stack_with_every_key_and_files_in_out(tmp_path):
    methods = "direct,cascade/osqp"
    # In a process of its own, without the tests' shape checks, which slow every phase.
    command = [sys.executable, "-m", "benchmarks", "tick", "--ticks", "30", "--json"]
    command += ["--out", str(tmp_path), "--methods", methods]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    rows = [json.loads(line) for line in text.splitlines()]
    assert [(r["stack"], r["solver"]) for r in rows] == [
        ("table1", "direct"),
        ("table1", "cascade/osqp"),
        ("default", "direct"),
        ("default", "cascade/osqp"),
    ]
    for row in rows:
        assert row.keys() == tick_result().to_json().keys()
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


@pytest.mark.parametrize(("stance", "contacts", "effectors"), [("double", 2, 2), ("single", 1, 3)])
def test_the_table_of_the_paper_has_its_variables_and_rows(stance, contacts, effectors):
    robot = load_robot("humanoid33")
    controller = WholeBodyController(robot, bench_stack(robot, "table1", stance))
    controller.step(RobotState(robot.q_home, np.zeros(robot.nv)))
    # Table 1 of the paper: n + 6 + 6 c variables; base dynamics, torque limits, contacts, cones,
    # acceleration limits, CoM, pelvis, end effectors. One bound a normal force more.
    n = robot.nj
    rows = 6 + n + 6 * contacts + 10 * contacts + n + 3 + 3 + 6 * effectors + contacts
    assert controller.size == (n + 6 + 6 * contacts, rows)


def test_the_table_has_a_line_a_method_and_marks_failures():
    reduced = tick_result(controller="reduced", ratio_to_whole=0.5)
    peer = tick_result(
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
    lines = format_table([tick_result(), reduced, peer]).splitlines()
    assert lines[0].startswith("humanoid33, 33 joints, double support, stack 'table1'")
    assert lines[2].split()[:4] == ["whole_body", "direct", "100", "120"]
    assert lines[3].split()[:2] == ["reduced", "direct"]
    assert lines[3].split()[11:13] == ["1.00", "0.50"]
    assert lines[4].startswith("peer, in batches")
    assert lines[4].split()[6:11] == ["-"] * 5
    assert lines[4].endswith("3 of 10 ticks FAILED")
    assert "FAILED" not in lines[2]
