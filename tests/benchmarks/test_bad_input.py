import sys

import pytest

from benchmarks.__main__ import main


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["tock"], "unknown benchmark"),
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
        (["bias", "--robot", "humanoid33"], "fixed base"),
        (["bias", "--robot", "upper"], "unknown robot"),
        (["bias", "--ticks", "0"], "at least one tick"),
        (["bias", "--stack", "both"], "belongs to the benchmark tick"),
        (["bias", "--methods", "direct"], "belongs to the benchmark tick"),
        (["bias", "--controller", "osf"], "belongs to the benchmark tick"),
        (["tick", "--controller", "walk"], "teleop"),
        (["tick", "--controller", "teleop", "--robot", "arm6"], "cannot walk on two feet"),
        (["tick", "--controller", "teleop", "--robot", "biped"], "unknown robot"),
        (["tick", "--controller", "teleop", "--ticks", "0"], "at least one tick"),
        (["tick", "--controller", "teleop", "--contacts", "double"], "controllers of tasks"),
        (["tick", "--controller", "teleop", "--stack", "both"], "controllers of tasks"),
        (["tick", "--controller", "teleop", "--methods", "direct"], "controllers of tasks"),
        (["tick", "--controller", "teleop", "--peers", "tsid=python"], "controllers of tasks"),
        (["tick", "--joints", "33"], "belongs to the benchmark dof"),
        (["dof", "--joints", "19"], "humanoid20"),
        (["dof", "--joints", "many"], "not a number"),
        (["dof", "--joints", ","], "nothing to time"),
        (["dof", "--contacts", "triple"], "double"),
        (["dof", "--stack", "both"], "table1"),
        (["dof", "--ticks", "1"], "10 ticks"),
        (["dof", "--robot", "g1"], "belongs to the benchmark"),
        (["peers", "--peers", "tsid=/nowhere/bin/python"], "does not exist"),
        (["peers", "--peers", "libdwbc=/nowhere/peer"], "the program of peer 'libdwbc' does not"),
        (["peers", "--peers", f"drake={sys.executable}"], "unknown peer"),
        (["peers", "--methods", "direct"], "belongs to the benchmark tick"),
        (["tick", "--peers", f"drake={sys.executable}"], "unknown peer"),
        (["tick", "--peers", f"mink={sys.executable}"], "unknown peer of whole_body"),
        (["ik", "--peers", f"tsid={sys.executable}"], "unknown peer of differential_ik"),
        (["ik", "--methods", "hqp"], "belongs to the benchmark tick"),
        (["first", "--controller", "teleop"], "no such controller"),
        (["first", "--ticks", "3"], "belongs to the benchmark"),
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
