"""Stand-ins for workers: what is asked for is done at once, here."""

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

from poise.apps.campaigns import Workers


class Here(Workers):
    """Calls functions in this process, one at a time, and warms nothing up."""

    def __init__(self):
        self.done, self.calls = [], 0

    @property
    def free(self):
        return 1 - len(self.done)

    def submit(self, ticket, function, item):
        self.calls += 1
        self.done.append((ticket, function(item)))

    def wait(self):
        done, self.done = self.done, []
        return done

    def warm(self, function, item):
        self.warmed = [job.values for kind in item for job in kind.jobs]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


@pytest.fixture
def here():
    return Here()
