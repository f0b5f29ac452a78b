"""`python -m benchmarks first`: parts of the first use, and what they may take."""

import json

import pytest

from benchmarks import first
from benchmarks.__main__ import main


@pytest.fixture
def processes(monkeypatch):
    """Answers of made-up processes; the first of them finds nothing compiled."""
    asked = []

    def start(command, environment):
        asked.append((command[2:], environment))
        if len(command) == 2:
            return ""
        made = 21.0 if len(asked) == 2 else 0.2 + 0.01 * len(asked)
        times = [0.1, 0.5, 0.6, 0.6 + made]
        answer = {"times": times, "wall": 2.0 * made, "tick": 1e-3, "status": "ok"}
        return f"something else\n{json.dumps(answer)}\n"

    monkeypatch.setattr(first, "_start", start)
    return asked


def test_the_empty_cache_and_the_second_process_have_bounds(processes, capsys):
    assert main(["first", "--controller", "osf", "--json"]) == 0
    empty, second, *figures = map(json.loads, capsys.readouterr().out.splitlines())
    assert (empty["process"], empty["runs"], second["process"], second["runs"]) == (
        "empty cache",
        1,
        "second",
        10,
    )
    assert empty["controller_s"] == pytest.approx(21.0)
    assert empty["controller_wall_s"] == pytest.approx(42.0)
    # The 10th percentile of 0.23, 0.24, ..., and 0.4 s of import.
    assert second["controller_s"] == pytest.approx(0.239)
    assert second["both_s"] == pytest.approx(0.639)
    assert [(f["bound"], f["ours"], f["ok"]) for f in figures] == [
        (25.0, empty["controller_s"], True),
        (0.8, second["both_s"], True),
    ]
