"""The benchmark `hqp` on the command line, and the tables in the documentation that it made."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.hqp.bench import FAMILY_HEADS, SEQUENCE_HEADS
from benchmarks.hqp.methods import METHODS
from benchmarks.hqp.problem_set import FAMILIES, ProblemSequence, save_sequence
from benchmarks.hqp.problem_sources import USUAL_SEQUENCES, sequence_names
from poise.hqp import ACCURACY, HierarchicalProblem, Level

PAGE = Path(__file__).parents[3] / "docs" / "hqp_benchmark.md"


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


def test_the_table_is_markdown(folder, capsys):
    arguments = ["--problems", str(folder), "--methods", "weighted", "--count", "3"]
    assert main(["hqp", *arguments, "--sequences", "a-moving"]) == 0
    family, sequences = tables(capsys.readouterr().out)
    starts = ["cold", "warm"]
    assert family[0] == ["method", *(f"{s} {head}" for s in starts for head in FAMILY_HEADS)]
    assert [line[0] for line in family[1:]] == ["direct", "weighted"]
    assert sequences[0] == [*SEQUENCE_HEADS, "direct", "weighted"]
    assert [line[:6] for line in sequences[1:]] == [
        ["a-moving", "cold", "2", "3", "2", "3"],
        ["a-moving", "warm", "2", "3", "2", "2"],
    ]


def test_sequences_are_made_where_none_are_given(capsys):
    wanted = ["--sequences", "ik-planar-3", "--methods", "daqp-hard", "--count", "4", "--json"]
    assert main(["hqp", *wanted]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert {row["sequence"] for row in rows} == {"ik-planar-3"}
    assert {row["family"] for row in rows} == {"inverse kinematics"}


def test_the_usual_sequences_can_be_made_and_are_of_every_family():
    assert set(USUAL_SEQUENCES) <= set(sequence_names())
    assert len(set(USUAL_SEQUENCES)) == len(USUAL_SEQUENCES)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--methods", "gurobi"], "cascade/osqp"),
        (["--methods", "cascade/gurobi"], "unknown method"),
        (["--sequences", "walk"], "walk-lift-off-humanoid33"),
        (["--problems", "nowhere"], "no problem sequences"),
        (["--count", "1"], "--count 2 or more"),
        (["--count", "-5"], "--count 2 or more"),
        (["--save", "folder", "--methods", "weighted"], "races nothing"),
        (["--save", "folder", "--json"], "races nothing"),
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


def test_a_sequence_that_the_folder_does_not_have_is_refused(folder, capsys):
    assert main(["hqp", "--problems", str(folder), "--sequences", "c"]) == 2
    assert "a-moving, b-still" in capsys.readouterr().err


def tables(text: str) -> list[list[list[str]]]:
    """The cells of every Markdown table, the line below the heads left out."""
    found: list[list[list[str]]] = []
    for block in re.findall(r"(?:^\|.*\|\n?)+", text, re.MULTILINE):
        lines = [
            [cell.strip() for cell in line.strip("|").split("|")] for line in block.split("\n")
        ]
        assert all(set(cell) == {"-"} for cell in lines[1])
        found.append([lines[0], *(line for line in lines[2:] if line != [""])])
    return found


def test_the_table_of_the_page_is_the_first_that_the_command_makes():
    page = PAGE.read_text(encoding="utf-8")
    output = re.search(r"<!-- begin of the output -->\n(.*)<!-- end of the output -->", page, re.S)
    assert output is not None
    (table,) = tables(output[1])
    usual = [
        name for name in METHODS if name in ("direct", "daqp-hard", "daqp-hierarchical", "weighted")
    ]
    usual += [f"cascade/{backend}" for backend in ACCURACY]
    assert re.findall(r"^\*\*(.*?)\*\*: \d+ seq", output[1], re.MULTILINE) == [FAMILIES[0]]
    starts = ["cold", "warm"]
    assert table[0] == ["method", *(f"{s} {head}" for s in starts for head in FAMILY_HEADS)]
    assert [line[0] for line in table[1:]] == usual
    assert all(len(line) == len(table[0]) for line in table)
