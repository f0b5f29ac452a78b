"""Robots for all tests, loaded once a session."""

import math
from functools import cache

import pytest
import type_checks

from poise import _progress
from poise.errors import MissingExtraError
from poise.hqp import LexicographicSolver
from poise.robots import load_robot


@cache
def _load(name):
    return load_robot(name)


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
