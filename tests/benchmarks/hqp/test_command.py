"""The benchmark `hqp` on the command line, and the tables in the documentation that it made."""

import json

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.hqp.problem_set import ProblemSequence, save_sequence
from poise.hqp import HierarchicalProblem, Level


def moving(count: int) -> tuple[HierarchicalProblem, ...]:
    """A limit that a target crosses on its way."""
    limit = Level([[1.0, 0.5]], -np.inf, 1.0)
    targets = [0.2 * i for i in range(count)]
    return tuple(HierarchicalProblem([limit, Level(np.eye(2), t, t)]) for t in targets)


@pytest.fixture
def folder(tmp_path):
    for name, family, consecutive in (
        ("a-moving", "recorded", True),
        ("b-still", "random", False),
    ):
        save_sequence(
            ProblemSequence(
                name=name,
                family=family,
                description="A target that crosses a limit.",
                consecutive=consecutive,
                problems=moving(8),
            ),
            tmp_path / "problems",
        )
    return tmp_path / "problems"


def test_one_json_object_a_sequence_method_and_start_and_files_on_demand(folder, tmp_path, capsys):
    out = tmp_path / "out"
    wanted = ["--methods", "daqp-hierarchical,cascade/daqp", "--json", "--out", str(out)]
    assert main(["hqp", "--problems", str(folder), *wanted]) == 0
    printed = capsys.readouterr().out
    rows = [json.loads(line) for line in printed.splitlines()]
    methods = ["direct", "daqp-hierarchical", "cascade/daqp"]
    assert [(row["sequence"], row["start"], row["method"], row["count"]) for row in rows] == [
        (name, start, method, count)
        for name, start, count in (
            ("a-moving", "cold", 8), ("a-moving", "warm", 7), ("b-still", "cold", 8),
        )
        for method in methods
    ]  # fmt: skip
    assert set(rows[0]) == {
        "sequence", "family", "n", "rows", "levels", "count", "method", "start", "p50_us",
        "p99_us", "max_us", "solved", "silent", "gap", "cost_gap", "ratio_to_direct", "statuses",
    }  # fmt: skip
    for row in rows:
        assert (row["n"], row["rows"], row["levels"]) == (2, 3, 2)
        assert 0.0 < row["p50_us"] <= row["p99_us"] <= row["max_us"]
        assert sum(row["statuses"].values()) == row["count"]
        if row["method"] != "daqp-hierarchical":
            assert (row["solved"], row["silent"]) == (1.0, 0)
    assert (out / "hqp.json").read_text() == printed
    assert (out / "hqp.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--methods", "gurobi"], "cascade/osqp"),
        (["--sequences", "walk"], "walk-lift-off-humanoid33"),
        (["--problems", "nowhere"], "no problem sequences"),
        (["--count", "1"], "--count 2 or more"),
        (["--save", "folder", "--methods", "weighted"], "races nothing"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["hqp", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    assert words in captured.err
    assert list(tmp_path.iterdir()) == []
