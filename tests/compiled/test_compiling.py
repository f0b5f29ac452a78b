"""Compiled functions: kept on disk, and made anew when what they call changes."""

import importlib
import os
import subprocess
import sys

import numpy as np
import pytest

from poise._compiled import compiled

CALLEE = """
from poise._compiled import compiled

FACTOR = {factor}

@compiled
def scaled(x: float) -> float:
    return {times} * x
"""

CALLER = """
from callee import FACTOR, scaled
from poise._compiled import compiled

@compiled
def run(x: float) -> float:
    return FACTOR + scaled(x)
"""

ASK = """
import caller
print(caller.run(1.0), sum(caller.run.stats.cache_hits.values()))
"""


def ask(folder):
    done = subprocess.run(
        [sys.executable, "-B", "-c", ASK],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=True,
    )
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.mark.slow
def test_code_is_kept_until_a_callee_or_a_number_of_another_file_changes(tmp_path):
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(factor=1.0, times=2.0))
    assert ask(tmp_path) == (3.0, 0)
    assert ask(tmp_path) == (3.0, 1)
    (tmp_path / "callee.py").write_text(CALLEE.format(factor=1.0, times=5.0))
    assert ask(tmp_path) == (6.0, 0)
    (tmp_path / "callee.py").write_text(CALLEE.format(factor=7.0, times=5.0))
    assert ask(tmp_path) == (12.0, 0)


def test_nothing_that_can_be_divided_by_zero_raises():
    @compiled
    def ratio(x: float, y: float) -> float:
        return x / y

    assert ratio(1.0, 0.0) == np.inf
    assert np.isnan(ratio(0.0, 0.0))


def test_nan_keeps_its_meaning():
    @compiled
    def is_beyond(x: float, bound: float) -> bool:
        return not x <= bound

    assert is_beyond(float("nan"), 1.0)
    assert not is_beyond(0.5, 1.0)


@pytest.mark.parametrize("module", ["poise._compiled._linalg", "poise.dynamics._reduction"])
def test_compiled_functions_say_what_they_are(module):
    functions = [f for f in vars(importlib.import_module(module)).values() if hasattr(f, "stamp")]
    assert functions
    assert all(f.__name__ for f in functions)
