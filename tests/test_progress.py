"""Progress is shown to whoever looks: a bar in a terminal or notebook, lines in a file."""

import sys
from types import ModuleType

import pytest

import poise._progress as progress
from poise._progress import Bar


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets."""
    now = [0.0]
    monkeypatch.setattr(progress, "monotonic", lambda: now[0])
    monkeypatch.setattr(progress, "LINE_EVERY", 5.0)
    return now


def test_where_nothing_can_be_drawn_over_a_line_comes_every_five_seconds(clock, capsys):
    with Bar("simulating", " s") as bar:
        for tick in range(201):
            clock[0] = 0.1 * tick
            bar(0.05 * tick, 10.0)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "simulating: 2.5 of 10 s (25%), 15 s left",
        "simulating: 5 of 10 s (50%), 10 s left",
        "simulating: 7.5 of 10 s (75%), 5 s left",
    ]


def test_a_long_pause_is_one_line(clock, capsys):
    bar = Bar("episodes", " episodes")
    bar(3.0, 9.0)
    for clock[0] in (31.0, 32.0, 34.0, 35.1):
        bar(6.0, 9.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "episodes: 6 of 9 episodes (67%), 31 s left",
        "episodes: 6 of 9 episodes (67%), 35 s left",
    ]


def test_work_that_stands_still_or_has_no_end_says_no_time_left(clock, capsys):
    for total, said in ((9.0, "(0%)"), (0.0, "")):
        clock[0] = 0.0
        bar = Bar("waiting", "")
        bar(0.0, total)
        clock[0] = 6.0
        bar(0.0, total)
        err = capsys.readouterr().err
        assert err.strip().endswith(said)
        assert "left" not in err


@pytest.mark.parametrize("where", ["terminal", "notebook"])
def test_where_it_can_be_drawn_over_there_is_a_bar(monkeypatch, capsys, where):
    monkeypatch.setattr("poise._progress.PATIENCE", 0.0)
    if where == "terminal":
        monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    else:
        monkeypatch.setitem(sys.modules, "ipykernel", ModuleType("ipykernel"))
    with Bar("simulating", " s") as bar:
        for done in range(11):
            bar(float(done), 10.0)
    err = capsys.readouterr().err
    assert "\r" in err
    assert "simulating" in err
