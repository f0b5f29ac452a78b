"""Robots for all tests, loaded once a session."""

import math
from functools import cache

import jaxtyping
import pytest

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


@pytest.fixture
def unchecked():
    """No run-time checks of types and shapes, in runs of thousands of ticks.

    They take six times as long as everything else, and other tests make the same calls.
    """
    before = jaxtyping.config.jaxtyping_disable
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)
