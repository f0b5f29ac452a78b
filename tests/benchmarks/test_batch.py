"""`python -m benchmarks batch`: states of a batch beside single ticks."""

import json

import pytest

pytest.importorskip("mujoco")

from benchmarks import batch
from benchmarks.__main__ import main


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(batch, "ROUNDS", 2)
    # What processes do needs two of them, which takes seconds.
    monkeypatch.setattr(batch, "_processes", lambda plan, states: 2.0)


def test_a_state_is_timed_and_its_figures_have_bounds(capsys):
    assert main(["batch", "--robot", "humanoid20", "--ticks", "40", "--json"]) == 0
    result, *figures = map(json.loads, capsys.readouterr().out.splitlines())
    assert (result["robot"], result["stack"], result["states"]) == ("humanoid20", "default", 40)
    assert result["single_us"] > 0.0
    assert result["first_us"] > 0.0
    assert result["difference"] < 1e-6
    dear, gain = figures
    assert dear["ok"] is (dear["ours"] <= dear["bound"] == 1.2)
    assert gain["ok"] is (gain["ours"] >= gain["bound"] == 1.8)
    assert dear["ours"] == result["batch_over_single"]
    assert gain["ours"] == result["threads"]
