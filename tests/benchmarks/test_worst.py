"""`python -m benchmarks worst`: the worst tick of a scenario's runs."""

import json

import numpy as np
import pytest

pytest.importorskip("mujoco")

from benchmarks.__main__ import main
from benchmarks.worst import _result
from poise.apps.scenarios import load_scenario
from tests.benchmarks.test_running import SHORT


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


def test_a_ticks_own_time_is_its_least_and_the_first_does_not_count():
    seconds = 1e-6 * np.array(
        [
            [900.0, 10.0, 80.0, 10.0, 11.0],
            [900.0, 90.0, 60.0, 12.0, 10.0],
            [900.0, 9.0, 70.0, 9.0, 9.0],
        ]
    )
    found = _result(load_scenario("stand"), seconds, 0.25)
    assert (found.runs, found.ticks, found.collection_ms) == (3, 5, 0.25)
    assert (found.p50_us, found.max_us, found.ratio, found.slow) == (9.0, 60.0, 6.67, 1)
    assert found.at_s == pytest.approx(2 * load_scenario("stand").duration / 5)


def test_runs_are_repeated_and_figures_have_bounds(short, capsys):
    assert main(["worst", "--scenarios", str(short), "--ticks", "500", "--json"]) == 0
    result, worst, garbage = map(json.loads, capsys.readouterr().out.splitlines())
    assert (result["scenario"], result["runs"], result["ticks"]) == ("short", 3, 200)
    assert worst["ok"] is (worst["ours"] <= worst["bound"] == 5.0)
    assert worst["ours"] == result["ratio"] >= 1.0
    assert garbage["ok"] is (garbage["ours"] <= garbage["bound"] == 1.0)


def test_the_table_says_what_holds(short, capsys):
    assert main(["worst", "--scenarios", str(short), "--ticks", "1"]) == 0
    assert "short on humanoid20: worst own tick" in capsys.readouterr().out


def test_no_ticks_are_refused(capsys):
    assert main(["worst", "--ticks", "0"]) == 2
    assert "1 tick" in capsys.readouterr().err
