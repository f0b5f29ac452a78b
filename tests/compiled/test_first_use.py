"""Machine code: reported while made, kept once, remade with its source, possible without a disk."""

import os
import subprocess
import sys

import numpy as np
import pytest

from poise._compiled import compiled

SOURCE = """
from other import FACTOR, scaled
from poise._compiled import compiled, say_if_slow

@compiled
def run(x: float) -> float:
    return FACTOR + scaled(x, 2) + scaled(x, 4)
"""

OTHER = """
from poise._compiled import part

FACTOR = 1.0

@part
def scaled(x: float, times: int) -> float:
    return times * x
"""

ASK = """
import gc, logging, sys
logging.basicConfig(format="%(message)s")
import poise._progress
poise._progress.PATIENCE = 0.0
import source
{before}
source.say_if_slow(source.run, "the test")
print(source.run(1.0), sum(source.run.stats.cache_hits.values()), gc.isenabled())
print(len(source.run.signatures), len(source.scaled.signatures))
"""

LATER = """
import sys
from other import scaled
from poise._compiled import compiled
from source import run
print(run(1.0), sum(run.stats.cache_hits.values()), "numba.np.arraymath" in sys.modules)

@compiled
def later(x: float) -> float:
    return run(x) + scaled(x, 3)

print(later(1.0))
"""

FULL = """
import errno
from numba.core.caching import IndexDataCacheFile
def full(*_):
    raise OSError(errno.ENOSPC, "No space left on device")
IndexDataCacheFile.{what} = full
"""


def a_folder(path):
    (path / "source.py").write_text(SOURCE)
    (path / "other.py").write_text(OTHER)
    (path / "cache").mkdir()
    return path


@pytest.fixture
def folder(tmp_path):
    """With source code, none of which is compiled."""
    return a_folder(tmp_path)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A folder in which everything was compiled once, and the answer of that process."""
    folder = a_folder(tmp_path_factory.mktemp("used"))
    return folder, *ask(folder)


def start(folder, before="", script=ASK, **environment):
    known = [p for p in sys.path if p]
    return subprocess.Popen(
        [sys.executable, "-B", "-c", script.format(before=before)],
        cwd=folder,
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(folder), *known]),
            "NUMBA_CACHE_DIR": str(folder / "cache"),
            **environment,
        },
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process, value=7.0):
    """Number of hits of the cache, stderr, and numbers of signatures."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    answer, hits, collects = out.splitlines()[0].split()
    assert float(answer) == value
    assert collects == "True"
    return int(hits), err, out.splitlines()[1]


def ask(folder, before="", value=7.0, **environment):
    return finish(start(folder, before, **environment), value)


def test_it_is_announced_once_and_compiled_once_whatever_numbers_a_call_names(first):
    folder, hits, said, signatures = first
    assert hits == 0
    assert "compiling the test, once on this machine: 2 functions" in said
    assert "compiled the test in" in said
    assert str(folder / "cache") in said
    assert signatures == "1 1"
    assert ask(folder) == (1, "", "1 0")


def test_code_is_read_without_the_compiler_and_is_called_by_later_code(first):
    folder = first[0]
    (folder / "later.py").write_text(LATER)
    out, err = start(folder, script="import later").communicate(timeout=300)
    assert out.splitlines() == ["7.0 1 False", "10.0"], err


def test_a_terminal_shows_a_bar(folder):
    _, said, _ = ask(folder, "sys.stderr.isatty = lambda: True")
    assert "compiling the test, once on this machine  30% [#######" in said
    assert "s left" in said


@pytest.mark.slow
@pytest.mark.parametrize(("old", "new", "value"), [("* x", "* 2 * x", 13.0), ("1.0", "3.0", 9.0)])
def test_code_is_made_anew_where_a_callee_or_a_number_of_another_file_changes(
    folder, old, new, value
):
    ask(folder)
    (folder / "other.py").write_text(OTHER.replace(old, new))
    # Never the code of another version, even where a disk was full.
    assert ask(folder, FULL.format(what="_save_data"), value)[0] == 0
    assert ask(folder, value=value)[0] == 0
    assert ask(folder, value=value)[0] == 1


@pytest.mark.slow
def test_two_processes_at_once(folder):
    for process in [start(folder), start(folder)]:
        finish(process)
    assert ask(folder)[0] == 1


@pytest.mark.slow
def test_another_processor_has_code_of_its_own(folder):
    ask(folder)
    hits, said, _ = ask(folder, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
    assert hits == 0
    assert "compiling the test" in said
    assert ask(folder)[0] == ask(folder, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")[0] == 1


@pytest.mark.slow
@pytest.mark.parametrize("what", ["_save_data", "_save_index"])
def test_a_full_disk(folder, what):
    hits, said, _ = ask(folder, FULL.format(what=what))
    assert hits == 0
    assert "compiled code cannot be written in" in said
    assert "No space left on device" in said
    assert "NUMBA_CACHE_DIR" in said
    assert ask(folder)[0] == 0
    assert ask(folder)[0] == 1


def test_a_damaged_file(first):
    folder = first[0]
    for path in (folder / "cache").rglob("source.run*"):
        path.write_bytes(path.read_bytes()[:-40])
    assert ask(folder)[0] == 0
    assert ask(folder)[0] == 1


ELSEWHERE = """
from poise._compiled import _kept_code as kept
kept._Places._locator_classes = ({classes})
import importlib
source.scaled = importlib.reload(sys.modules["other"]).scaled
source = importlib.reload(source)
"""


def test_no_folder_that_can_be_written(folder):
    hits, said, _ = ask(folder, ELSEWHERE.format(classes=""))
    assert hits == 0
    assert "not kept: no folder can be written" in said


def test_the_temporary_folder_is_the_last_resort_unless_others_can_write_there(folder):
    last = ELSEWHERE.format(classes="kept._InTemporaryFolder,")
    own = folder / f"poise-{os.getuid()}"
    assert str(own) in ask(folder, last, TMPDIR=str(folder))[1]
    assert ask(folder, last, TMPDIR=str(folder))[:2] == (1, "")
    own.chmod(0o777)
    hits, said, _ = ask(folder, last, TMPDIR=str(folder))
    assert hits == 0
    assert "not kept: no folder can be written" in said


def test_nothing_raises_on_a_zero_divisor_and_nan_keeps_its_meaning():
    @compiled
    def ratio(x: float, y: float) -> float:
        return x / y

    @compiled
    def is_beyond(x: float, bound: float) -> bool:
        return not x <= bound

    assert ratio(1.0, 0.0) == np.inf
    assert np.isnan(ratio(0.0, 0.0))
    assert is_beyond(float("nan"), 1.0)
    assert not is_beyond(0.5, 1.0)
