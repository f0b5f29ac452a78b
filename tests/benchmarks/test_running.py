"""`python -m benchmarks run`: where the processor time of a whole run goes."""

import json
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("zstandard")

from benchmarks.__main__ import main
from benchmarks.running import PARTS, _result, _Watched, run_figures
from poise.apps.scenarios import run_scenario

SHORT = """
name: short
robot: humanoid20
duration: 0.2
stack:
  contacts:
    - surface: {frame: left_sole}
    - surface: {frame: right_sole}
  levels:
    - - com
    - - posture
"""


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


def test_runs_are_timed_by_parts_repeated_and_their_figures_have_bounds(short, capsys):
    assert main(["run", "--scenarios", str(short), "--ticks", "500", "--json"]) == 0
    run, garbage, worst = map(json.loads, capsys.readouterr().out.splitlines())
    assert (run["scenario"], run["robot"], run["ticks"]) == ("short", "humanoid20", 200)
    assert run["runs"] == 3
    assert set(run["parts_us"]) == set(PARTS)
    for part in ("physics", "sensors", "estimator", "leader", "control", "recording"):
        assert run["parts_us"][part] > 0.0
    assert run["real_time"] == pytest.approx(0.2 / run["processor_s"], rel=0.1)
    assert run["step_us"]["p50_us"] > run["control_us"]["p50_us"] > 0.0
    assert run["share_of_period"] == pytest.approx(1e-3 * run["step_us"]["p50_us"], abs=1e-4)
    assert run["missed_ticks"] == 0
    assert "garbage" in garbage["name"]
    assert garbage["ok"] is (garbage["ours"] <= garbage["bound"] == 1.0)
    assert garbage["ours"] == run["collection_ms"]
    assert worst["ok"] is (worst["ours"] <= worst["bound"] == 5.0)
    assert worst["ours"] == run["worst_over_median"] >= 1.0


def test_a_ticks_own_time_is_its_least_and_one_run_says_nothing_of_the_worst(short):
    run = run_scenario(str(short))
    control = 1e-6 * np.array(
        [[10.0, 80.0, 10.0, 11.0], [90.0, 60.0, 12.0, 10.0], [9.0, 70.0, 9.0, 9.0]]
    )
    watched = [
        Mock(
            spec=_Watched,
            steps=np.column_stack([np.full((4, 2), 1e-6), each]),
            missed=0,
            parts=dict.fromkeys(PARTS, 0.0),
        )
        for each in control
    ]
    found = _result(run, 1.0, 2.0, watched, [0.1, 0.25])
    assert (found.runs, found.collections, found.collection_ms) == (3, 2, 0.25)
    assert (found.control_us["p50_us"], found.control_us["max_us"]) == (9.0, 60.0)
    assert (found.worst_over_median, found.slow, found.worst_at_s) == (6.67, 1, 0.002)
    assert found.step_us["p50_us"] == 11.0
    assert [f.ok for f in run_figures([found])] == [True, False]
    assert len(run_figures([replace(found, runs=1)])) == 1


def test_the_table_has_the_parts_and_says_what_holds(short, capsys):
    assert main(["run", "--scenarios", str(short)]) == 0
    out = capsys.readouterr().out
    assert all(f"parts_us {part}" in out for part in PARTS)
    assert "ok    short on humanoid20: longest garbage" in out or "FAIL" in out


def test_no_ticks_are_refused(capsys):
    assert main(["run", "--ticks", "0"]) == 2
    assert "1 tick" in capsys.readouterr().err
