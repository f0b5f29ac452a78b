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
        (["tick", "--methods", "fast"], "unknown method"),
        (["tick", "--ticks", "0"], "at least one tick"),
        (["tick", "--peers", "tsid"], "NAME=PATH"),
        (["peers", "--peers", "tsid=/nowhere/bin/python"], "does not exist"),
        (["ik", "--peers", f"tsid={sys.executable}"], "unknown peer of differential_ik"),
        (["batch", "--stack", "both"], "table1"),
        (["run", "--robot", "biped"], "unknown robot"),
        (["run", "--ticks", "0"], "1 tick"),
        (["first", "--robot", "nobody"], "unknown robot"),
        (["latency", "--messages", "0"], "nothing to time"),
        (["latency", "--actuation", "position"], "velocity, torque"),
        (["keys", "--presses", "0"], "nothing to time"),
        (["tock"], "no such benchmark"),
        (["run", "--joints", "3"], "no such option"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, words, capsys):
    assert main([*arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith("benchmarks: ")
    assert words in line
