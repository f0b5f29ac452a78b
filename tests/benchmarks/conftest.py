import gc

import pytest

from benchmarks.recording import Recording, record_run
from poise.robots import load_robot


@pytest.fixture(scope="session", autouse=True)
def _set_aside():
    """Collections between what is timed do not go through all that other tests have made."""
    gc.freeze()


@pytest.fixture(scope="session")
def recording() -> Recording:
    return record_run(load_robot("humanoid33"), "double", 40)
