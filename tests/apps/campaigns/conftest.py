"""Workers that several tests share: each takes seconds to come up."""

import pytest


@pytest.fixture(scope="session")
def two():
    """Two workers, for tests that leave them as they were."""
    pytest.importorskip("mujoco")
    from poise.apps.campaigns import LocalWorkers

    with LocalWorkers(2) as workers:
        yield workers
