"""`poise warmup`: all that controllers need is compiled and kept, or one line says why not."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest

from poise.control import CONTROLLERS

USE = """
import json, sys
import numpy as np
from numba.core import event
import poise
from poise.control import CONTROLLERS, ControllerPlan, make_controller
from poise.dynamics import SensorReadings
from poise.estimation import StateEstimator
from poise.locomotion import StepTeleoperator
robot = poise.load_robot("humanoid33")
state = poise.RobotState(robot.q_home, np.zeros(robot.nv))
with event.install_recorder("numba:compile") as seen:
    estimator = StateEstimator(robot)
    upright = SensorReadings(np.zeros(3), np.array([0.0, 0.0, 9.81]), np.zeros(robot.nj))
    for k in range(5):
        told = poise.RobotState(robot.q_home, np.zeros(robot.nv), {}, 0.001 * k, upright)
        assert estimator.update(told) and estimator.status.ok
    for name, kind in CONTROLLERS.items():
        for strategy in kind.strategies:
            plan = ControllerPlan(name=name, strategy=strategy)
            if strategy not in ("cascade", "weighted"):
                assert make_controller(robot, None, plan).step(state).status.ok
    for actuation in ("torque", "velocity"):
        leader = StepTeleoperator(robot, actuation=actuation)
        controller = leader.controller()
        for k in range(5):
            told = poise.RobotState(robot.q_home, np.zeros(robot.nv), {}, 0.005 * k, upright)
            estimate = leader.estimator.update(told)
            leader.lead(estimate)
            assert controller.step(estimate).status.ok
heavy = [m for m in ("scipy.linalg", "scipy.optimize", "numba.np.arraymath") if m in sys.modules]
print(json.dumps([[str(e.data["dispatcher"]) for _, e in seen.buffer], heavy]))
"""

IN_ONE = """
from poise.control import warm_up
print(warm_up(["differential_ik"], processes=1))
"""

NO_PROCESS = """
import sys
from concurrent import futures
from poise.control import warm_up
def none(*_):
    raise OSError("no process can be started")
futures.ProcessPoolExecutor = none
print(warm_up(["differential_ik"], processes=2))
"""

MAIN = """
from poise.cli.main import main
sys.exit(main(["warmup", "--controller", "differential_ik"]))
"""

FULL = """
import errno, sys
from numba.core.caching import IndexDataCacheFile
def full(*_):
    raise OSError(errno.ENOSPC, "No space left on device")
IndexDataCacheFile._save_data = full
"""

LOOKS_ON = """
import sys
from poise import _progress
sys.stderr.isatty, _progress.PATIENCE = lambda: True, 0.0
"""


SMALL = "_differential_ik_*/_kernels.take_rows-*"
"""File of a small function, below the folder of all machine code."""


def environment(cache):
    """With machine code in a folder, made as quickly as can be: how fast it is does not matter."""
    return {**os.environ, "NUMBA_CACHE_DIR": str(cache), "NUMBA_OPT": "0"}


def run(cache, *command):
    return subprocess.run(
        [sys.executable, *command],
        env=environment(cache),
        capture_output=True,
        text=True,
        timeout=800,
    )


def warmup(cache, *options):
    return run(cache, "-m", "poise", "warmup", *options)


# Whoever comes first compiles everything, for as long as a busy machine takes.
pytestmark = pytest.mark.timeout(900)


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """A cache that was empty before one `poise warmup`, and what that said."""
    cache = tmp_path_factory.mktemp("cache")
    done = warmup(cache, "--json")
    assert done.returncode == 0, done.stderr
    return cache, json.loads(done.stdout), done.stderr


@pytest.fixture
def partly(warm, tmp_path):
    """The same without one function."""
    cache = tmp_path / "cache"
    shutil.copytree(warm[0], cache)
    forget(cache, SMALL)
    return cache


def forget(cache, code):
    files = list(cache.glob(code))
    assert files
    for file in files:
        file.unlink()


@pytest.mark.slow
def test_it_says_what_it_did_and_when_there_is_nothing_to_do(warm):
    cache, said, errors = warm
    assert errors == ""
    assert said["controllers"] == list(CONTROLLERS)
    assert said["functions"] > 150
    assert said["folder"] == str(cache)
    assert min(said["processor_s"], said["seconds"]) > 1.0
    done = warmup(cache)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"nothing to compile: all is kept in {cache}" in done.stdout


@pytest.mark.slow
def test_afterwards_no_controller_compiles_anything_nor_reads_the_compiler(warm):
    done = run(warm[0], "-c", USE)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [[], []]


@pytest.mark.slow
def test_only_what_is_missing_of_the_controllers_named_is_compiled(partly):
    forget(partly, "_osf_*/_contact_forces.measure-*")
    forget(partly, "_reduced_*/_problems._fill-*")
    first = json.loads(warmup(partly, "--controller", "osf", "--json").stdout)
    assert 0 < first["functions"] < 10
    assert warmup(partly, "--controller", "osf").stdout.count("nothing to compile") == 1
    rest = json.loads(warmup(partly, "--json").stdout)
    assert 0 < rest["functions"] < 10
    assert warmup(partly).stdout.count("nothing to compile") == 1


@pytest.mark.slow
def test_a_bar_where_somebody_looks_on_with_no_extra_installed(partly):
    done = run(partly, "-c", LOOKS_ON + MAIN)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\ncompiling +\d+% \[#", done.stderr)
    assert done.stderr.endswith("\033[K")


@pytest.mark.slow
@pytest.mark.parametrize("script", [IN_ONE, NO_PROCESS])
def test_one_process_does_it_where_no_other_can(partly, script):
    # Two jobs: one alone needs no other process anyway.
    forget(partly, "estimation_*/_tick.run-*")
    done = run(partly, "-c", script)
    assert (done.returncode, done.stderr) == (0, "")
    assert "functions=0" not in done.stdout
    assert "nothing to compile" in warmup(partly, "--controller", "differential_ik").stdout


def test_a_folder_that_cannot_be_written_and_a_controller_that_does_not_exist_are_one_line(
    tmp_path, refused
):
    (tmp_path / "file").write_text("")
    done = warmup(tmp_path / "file" / "cache")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "compiled code cannot be kept" in done.stderr
    assert str(tmp_path / "file") in done.stderr
    assert "no such controller; got 'ofs'" in refused("warmup", "--json", "--controller", "ofs")


@pytest.mark.slow
def test_a_full_disk_is_an_error(partly):
    done = run(partly, "-c", FULL + MAIN)
    assert done.returncode == 2
    assert "compiled code is not kept, such as that of poise.control._differ" in done.stderr
    assert "No space left on device" in done.stderr
