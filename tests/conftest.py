"""Robots for all tests, loaded once a session."""

import gc
import math
import subprocess
import sys
from collections import Counter
from contextlib import nullcontext
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest
import type_checks
import yaml

from poise import _progress, robots
from poise._compiled import find_unkept
from poise.errors import MissingExtraError
from poise.hqp import LexicographicSolver
from poise.robots import load_robot

DESCRIPTIONS = Path(robots.__file__).parent / "descriptions"


@cache
def _load(name):
    return load_robot(name)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Each worker has tests that stand together, and so share what a module makes once."""
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log) if config.getvalue("dist") == "load" else None


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes():
    """On a new machine all cores compile, each something else, before every worker does it all.

    Where that fails, tests say why.
    """
    if find_unkept():
        subprocess.run([sys.executable, "-m", "poise", "warmup"], check=False)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Of a test with `fast_cases(n)` all cases but the first n are slow.

    Files with slow tests come first: at the end a worker would wait for another's.
    """
    cases = Counter()
    for item in items:
        few = item.get_closest_marker("fast_cases")
        if few is not None:
            cases[item.function] += 1
            if cases[item.function] > few.args[0]:
                item.add_marker(pytest.mark.slow)
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.fixture(scope="session", autouse=True)
def _compiled():
    """Compiled before the first test: no test times it, and none of its processes says so."""
    LexicographicSolver()


@pytest.fixture(scope="session", autouse=True)
def _quiet():
    """A busy machine takes long enough for lines of progress, which have tests of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_progress, "LINE_EVERY", math.inf)
        yield


@pytest.fixture(scope="session", autouse=True)
def _little_garbage():
    """No search for garbage goes through the tests themselves, which takes half a second.

    Each rollout would begin with one: `tests/sim/test_rollout.py` sees to that.
    """
    gc.freeze()
    with pytest.MonkeyPatch.context() as patch:
        if find_spec("mujoco") is not None:
            patch.setattr("poise.sim._rollout.garbage_frozen", nullcontext)
        yield


@pytest.fixture(scope="session")
def get_robot():
    """A robot of the catalog by name; skips where its files are not installed."""

    def get(name):
        try:
            return _load(name)
        except MissingExtraError as error:
            pytest.skip(str(error))

    return get


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup():
    """Types and shapes of the first calls of each test are checked, see `type_checks`."""
    type_checks.begin_test()


@pytest.fixture(scope="session")
def get_robot_without(tmp_path_factory):
    """`humanoid33` with some joints welded at zero, and soles of another width."""

    @cache
    def get(*joints, width=0.14):
        facts = yaml.safe_load((DESCRIPTIONS / "humanoid33.yaml").read_text(encoding="utf-8"))
        del facts["catalog"]
        for sole in facts["soles"].values():
            sole["width"] = width
        path = tmp_path_factory.mktemp("welded") / "welded.urdf"
        path.write_text(_load("humanoid33").source.text, encoding="utf-8")
        return load_robot(path, description=facts | {"locked": list(joints)})

    return get
