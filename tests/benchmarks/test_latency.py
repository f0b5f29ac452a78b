"""The benchmark of the operator's latency: its stages are in order, and complete."""

import json

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("websockets")

from benchmarks.__main__ import main
from benchmarks.latency import STAGES


def test_every_stage_is_timed_from_pose_to_command(capsys):
    assert main(["latency", "--messages", "60", "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    stages, figures = lines[: len(STAGES)], lines[len(STAGES) :]
    assert [line["stage"] for line in stages] == list(STAGES)
    for line in stages:
        assert 0.0 <= line["p50_ms"] <= line["p99_ms"] <= line["max_ms"]
        assert line["messages"] >= 30
    whole = stages[-1]
    assert whole["max_ms"] >= max(line["max_ms"] for line in stages[:-1]) - 1e-9
    assert [figure["ours"] for figure in figures] == [whole["p50_ms"], whole["p99_ms"]]
    assert all(figure["ok"] is (figure["ours"] <= 20.0) for figure in figures)
