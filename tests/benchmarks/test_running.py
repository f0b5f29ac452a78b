"""`python -m benchmarks run`: where the processor time of a whole run goes."""

import json

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("zstandard")

from benchmarks.__main__ import main
from benchmarks.running import PARTS

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
