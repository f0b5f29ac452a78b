"""`python -m benchmarks dof`: a line a robot, stance and method, and the targets as ratios."""

import json
import subprocess
import sys

import pytest

from benchmarks.dof import format_dof_table, speed_targets
from benchmarks.result import PHASES, TickResult


def result(joints, controller, solver, p50, *, p99=None, assembly=10.0, contacts="double"):
    return TickResult(
        robot=f"humanoid{joints}",
        joints=joints,
        controller=controller,
        solver=solver,
        stack="table1",
        contacts=contacts,
        schedule="tick",
        variables=51,
        rows=124,
        p50_us=p50,
        p99_us=p50 if p99 is None else p99,
        max_us=3.0 * p50,
        cpu_min_us=p50,
        cpu_p10_us=p50,
        cpu_p50_us=p50,
        cpu_p99_us=1.5 * p50,
        phases_us=dict.fromkeys(PHASES, assembly),
        ticks=10,
        residual_max=1e-15,
        ratio_to_direct=1.0,
        ratio_to_whole=1.0,
        relaxed_ticks=0,
        missed_ticks=0,
    )


def robot(joints, full, reduced, full_osqp, reduced_osqp, **changes):
    return [
        result(joints, "whole_body", "direct", full, **changes),
        result(joints, "reduced", "direct", reduced, **changes),
        result(joints, "whole_body", "cascade/osqp", full_osqp, **changes),
        result(joints, "reduced", "cascade/osqp", reduced_osqp, **changes),
    ]


def test_targets_are_ratios_of_medians_and_say_whether_they_are_met():
    results = robot(33, 200.0, 120.0, 7000.0, 3500.0) + robot(60, 300.0, 240.0, 9000.0, 3000.0)
    found = {t.target: t for t in speed_targets(results)}
    cascade = found["33 joints: reduced over full tick, cascade/osqp"]
    assert (cascade.value, cascade.bound, cascade.met) == (0.5, 0.45, False)
    direct = found["33 joints: reduced over full tick, direct"]
    assert (direct.value, direct.bound, direct.met) == (0.6, 0.7, True)
    assert found["60 joints: reduced over full tick, direct"].met is False
    assert found["24 joints and more: reduced over full tick, direct, most"].value == 0.8
    times = found["33 joints: full cascade/osqp over reduced direct"]
    assert (times.value, times.relation, times.met) == (58.333, ">=", True)
    assert found["reduced direct: 60 over 33 joints"].value == 2.0
    assert found["reduced direct: assembly over tick, most"].value == pytest.approx(
        10 / 120, abs=1e-3
    )
    assert found["whole_body direct: p99 over p50 of processor time, most"].value == 1.5
    assert "45 joints: reduced over full tick, direct" not in found


def test_single_support_has_a_bound_of_its_own_and_misses_are_marked():
    results = robot(33, 200.0, 190.0, 7000.0, 2900.0, contacts="single", p99=500.0)
    found = {t.target: t for t in speed_targets(results)}
    assert found["33 joints: reduced over full tick, cascade/osqp"].bound == 0.40
    table = format_dof_table(results)
    assert "reduced direct, single support" in table
    missed = [line for line in table.splitlines() if line.endswith("MISSED")]
    assert any("p99 over p50" in line for line in missed)
    assert any("<= 0.7" in line for line in missed)


@pytest.mark.slow
def test_the_command_prints_four_methods_a_robot_and_the_targets():
    command = [sys.executable, "-m", "benchmarks", "dof", "--joints", "20"]
    command += ["--contacts", "double", "--ticks", "10", "--json"]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    lines = [json.loads(line) for line in text.splitlines()]
    rows = [line for line in lines if "target" not in line]
    assert [(r["controller"], r["solver"]) for r in rows] == [
        ("whole_body", "direct"),
        ("reduced", "direct"),
        ("whole_body", "cascade/osqp"),
        ("reduced", "cascade/osqp"),
    ]
    for row in rows:
        assert (row["robot"], row["joints"], row["contacts"]) == ("humanoid20", 20, "double")
        assert row["missed_ticks"] == 0
        assert row["ratio_to_whole"] > 0.0
        assert set(row["phases_us"]) == set(PHASES)
    assert rows[0]["ticks"] > rows[2]["ticks"] > 0
    targets = [line for line in lines if "target" in line]
    assert {"target", "contacts", "value", "relation", "bound", "met"} == set(targets[0])
