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


def test_a_run_is_timed_by_parts_and_its_figures_have_bounds(short, capsys):
    assert main(["run", "--scenario", str(short), "--json"]) == 0
    run, *figures = map(json.loads, capsys.readouterr().out.splitlines())
    assert (run["scenario"], run["robot"], run["ticks"]) == ("short", "humanoid20", 200)
    assert set(run["parts_us"]) == set(PARTS)
    for part in ("physics", "sensors", "estimator", "leader", "control", "recording"):
        assert run["parts_us"][part] > 0.0
    assert run["real_time"] == pytest.approx(0.2 / run["processor_s"], rel=0.1)
    (figure,) = figures
    assert "garbage" in figure["name"]
    assert figure["ok"] is (figure["ours"] <= figure["bound"] == 1.0)
    assert figure["ours"] == run["collection_ms"]


def test_the_table_has_the_parts_and_says_what_holds(short, capsys):
    assert main(["run", "--scenario", str(short)]) == 0
    out = capsys.readouterr().out
    assert all(part in out for part in PARTS)
    assert "s simulated in" in out
