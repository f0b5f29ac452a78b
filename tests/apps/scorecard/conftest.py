"""Workers that count what they are asked for."""

import pytest

pytest.importorskip("mujoco")

from poise.apps.campaigns import ThisProcess


class Here(ThisProcess):
    """Calls functions in this process, one at a time, and warms nothing up."""

    def __init__(self):
        self.calls, self.warmed = 0, []

    def submit(self, function, item):
        self.calls += 1
        return super().submit(function, item)

    def warm(self, function, item):
        self.warmed = [job.values for jobs, _ in item for job in jobs]


@pytest.fixture
def here():
    return Here()
