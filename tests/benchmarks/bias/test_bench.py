"""The benchmark of the bias formulas: what is timed is right, and what comes out is complete."""

import json

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.bias import BiasBench, bench_bias, format_bias_table
from benchmarks.bias.bench import count_operations
from benchmarks.bias.formulas import FORMULAS
from benchmarks.bias.recording import BiasInputs, record_motion
from poise.robots import load_robot

NAMES = ["original", "original_plain", "proposed", "numerical", "fused"]


@pytest.fixture(scope="module", params=["upper17", "arm6"])
def recorded(request):
    robot = load_robot(request.param)
    return robot, record_motion(robot)


def test_the_recorded_robot_moves_and_every_task_keeps_its_rank(recorded):
    robot, states = recorded
    assert len(states) == 550
    assert np.ptp([s.q for s in states], axis=0).max() > 0.05
    inputs = BiasInputs(robot)
    for state in states[::50]:
        inputs.of(state)
        assert inputs._recursion.regular


def test_the_torso_of_the_second_study_turns_by_15_degrees():
    robot = load_robot("upper17")
    states = record_motion(robot)
    turned = states[-1].q - robot.q_home
    assert np.degrees(turned[0]) == pytest.approx(15.0, abs=0.05)
    assert np.abs(np.degrees(turned[1:5])).max() < 0.05


def test_the_timed_formulas_give_the_same_bias_acceleration(recorded):
    robot, states = recorded
    inputs = BiasInputs(robot)
    for state in states[1:300]:
        tick = inputs.of(state)
    found = {name: formula(tick) for name, formula in FORMULAS.items()}
    for i, task in enumerate(tick.tasks[1:]):
        size = np.abs(found["original"][i]).max()
        assert size > 1e-3
        for name, extra in (("original_plain", 0.0), ("proposed", 0.0), ("fused", task.drift_p)):
            np.testing.assert_allclose(
                found[name][i] - extra, found["original"][i], atol=1e-10 * max(size, 1.0)
            )
        # Late by up to a period, but the same quantity.
        np.testing.assert_allclose(found["numerical"][i], found["original"][i], atol=0.1 * size)


def test_operations_are_those_of_the_formulas(recorded):
    robot, states = recorded
    tick = BiasInputs(robot).of(states[100])
    counts = count_operations(tick)
    n = robot.nv
    fused = sum(
        above.J.shape[0]  # alpha
        + n * (2 * above.J.shape[0] - 1)  # Jbar alpha
        + task.J.shape[0] * 2 * n  # J S + drift
        for above, task in zip(tick.tasks, tick.tasks[1:], strict=False)
    )
    sums = n * (len(tick.tasks) - 2)
    assert counts["fused"] == fused + sums
    saved = sum(len(task.drift) for task in tick.tasks[1:])
    assert counts["proposed"] == counts["fused"] + saved
    assert counts["fused"] < 0.2 * counts["original_plain"] < 0.2 * counts["original"]


def test_results_are_complete_and_the_original_comes_first():
    seen = []
    results = bench_bias(BiasBench(ticks=60), lambda done, total: seen.append((done, total)))
    assert [r.formula for r in results] == NAMES
    assert seen
    assert all(0 <= done <= total for done, total in seen)
    for r in results:
        assert (r.robot, r.joints, r.tasks, r.ticks) == ("upper17", 17, 3, 60)
        assert 0.0 < r.p50_us <= r.p99_us <= r.max_us
        assert r.mean_us <= r.max_us
    by_name = {r.formula: r for r in results}
    assert by_name["original"].ratio_to_original == 1.0
    # Types are checked inside the clock here: the others' ratios mean nothing.
    assert by_name["fused"].flops < by_name["proposed"].flops
    table = format_bias_table(results)
    assert all(name in table for name in (*NAMES, "us", "FLOP"))


def test_the_command_prints_one_json_object_a_formula_and_writes_them(tmp_path, capsys):
    arguments = ["bias", "--robot", "arm6", "--ticks", "10", "--json"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    rows = [json.loads(line) for line in printed.splitlines()]
    assert [row["formula"] for row in rows] == NAMES
    assert set(rows[0]) == {
        "robot", "joints", "tasks", "formula", "mean_us", "std_us", "p50_us", "p99_us", "max_us",
        "ratio_to_original", "flops", "ticks",
    }  # fmt: skip
    assert (tmp_path / "bench.json").read_text() == printed
