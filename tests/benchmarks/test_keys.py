"""The benchmark of a key's way: every press and release is timed, and figures have bounds."""

import json
import shutil

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("websockets")
pytest.importorskip("playwright")

from benchmarks.__main__ import main


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium on this machine")
def test_presses_and_releases_are_timed(capsys):
    assert main(["keys", "--robot", "humanoid33", "--presses", "2", "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    times, figures = lines[:2], lines[2:]
    assert [line["event"] for line in times] == ["pressed", "let go"]
    for line in times:
        assert 0.0 < line["p50_ms"] <= line["p99_ms"] <= line["max_ms"]
        assert line["presses"] == 2
    spans = [ms for line in times for ms in (line["p50_ms"], line["p99_ms"])]
    assert [figure["ours"] for figure in figures] == spans
    assert all(figure["ok"] is (figure["ours"] <= 50.0) for figure in figures)
