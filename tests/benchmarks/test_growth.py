"""`python -m benchmarks growth`: one number varied at a time."""

import json

import pytest

from benchmarks import growth
from benchmarks.__main__ import main


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(growth, "JOINTS", (20, 24))
    monkeypatch.setattr(growth, "ROBOT", "humanoid20")


def test_every_group_is_timed_and_compared_with_its_fewest(capsys):
    assert main(["growth", "--ticks", "20", "--json"]) == 0
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    counts = {}
    for one in found:
        counts.setdefault(one["of"], []).append(one["count"])
        assert one["missed_ticks"] == 0
        assert 0.0 < one["p10_us"] <= one["p50_us"]
    assert counts == {
        "joints": [20, 24],
        "levels": [1, 2, 3, 4, 5, 6],
        "tasks": [1, 2, 3, 4, 5, 6],
        "contacts": [1, 2, 3, 4],
    }
    assert all(one["ratio"] == 1.0 for one in found if one["count"] in (1, 20))
    # The same rows in all orders; three more with each task; a foot has six, a point three.
    rows = {of: [one["rows"] for one in found if one["of"] == of] for of in counts}
    assert len(set(rows["levels"])) == 1
    assert {b - a for a, b in zip(rows["tasks"], rows["tasks"][1:], strict=False)} == {3}
    variables = [one["variables"] for one in found if one["of"] == "contacts"]
    assert variables == [32, 38, 41, 44]


def test_too_few_ticks_are_refused(capsys):
    assert main(["growth", "--ticks", "3"]) == 2
    assert "20 ticks" in capsys.readouterr().err
