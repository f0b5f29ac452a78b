import sys

import pytest

from benchmarks.__main__ import main


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["tick", "--robot", "humanoid"], "unknown robot"),
        (["tick", "--robot", "arm6"], "floating base"),
        (["tick", "--contacts", "triple"], "double"),
        (["tick", "--stack", "table2"], "table1"),
        (["tick", "--controller", "whole"], "whole_body"),
        (["tick", "--methods", "cascade/gurobi"], "cascade/osqp"),
        (["tick", "--methods", "fast"], "unknown method"),
        (["tick", "--ticks", "0"], "at least one tick"),
        (["tick", "--ticks", "-3"], "at least one tick"),
        (["tick", "--peers", "tsid=/nowhere/bin/python"], "does not exist"),
        (["tick", "--peers", "tsid"], "NAME=PATH"),
        (["tick", "--controller", "walk"], "differential_ik"),
        (["run", "--scenarios", "over_an_obstacle", "--robot", "arm6"], "cannot walk on two feet"),
        (["run", "--robot", "biped"], "unknown robot"),
        (["run", "--ticks", "0"], "1 tick"),
        (["peers", "--peers", "tsid=/nowhere/bin/python"], "does not exist"),
        (["peers", "--peers", "libdwbc=/nowhere/peer"], "the program of peer 'libdwbc' does not"),
        (["peers", "--peers", f"drake={sys.executable}"], "unknown peer"),
        (["tick", "--peers", f"drake={sys.executable}"], "unknown peer"),
        (["tick", "--peers", f"mink={sys.executable}"], "unknown peer of whole_body"),
        (["ik", "--peers", f"tsid={sys.executable}"], "unknown peer of differential_ik"),
        (["first", "--controller", "teleop"], "no such controller"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, words, capsys):
    assert main([*arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("benchmarks: ")
    assert words in lines[0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["tock"], "invalid choice: 'tock'"),
        ([], "NAME"),
        (["run", "--contacts", "double"], "--contacts"),
        (["tick", "--joints", "33"], "--joints"),
        (["peers", "--methods", "direct"], "--methods"),
        (["first", "--ticks", "3"], "--ticks"),
        (["run", "--messages", "3"], "--messages"),
        (["hqp", "--robot", "g1"], "--robot"),
        (["tick", "--sequences", "stand-g1"], "--sequences"),
        (["tick", "--scenario", "walk"], "--scenario"),
    ],
)
def test_what_no_benchmark_takes_is_refused_with_its_usage(arguments, words, capsys):
    with pytest.raises(SystemExit) as left:
        main([*arguments])
    assert left.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("usage: python -m benchmarks")
    assert words in captured.err.splitlines()[-1]
