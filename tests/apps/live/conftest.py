"""A live session for a test, a browser, and the optional packages that they need."""

from contextlib import contextmanager
from importlib.util import find_spec

import pytest


@pytest.fixture(scope="session")
def live():
    """The package; skips where its extra is not installed."""
    for package in ("mujoco", "websockets"):
        if find_spec(package) is None:
            pytest.skip(f"the extra teleop is not installed: no {package}")
    import poise.apps.live

    return poise.apps.live


@pytest.fixture(scope="session")
def run_session(live, get_robot):
    """Starts a session on biped20, at velocity level, which is quick, unless asked for another."""
    from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT

    @contextmanager
    def run(folder, **options):
        options = {"plant": VELOCITY_TELEOP_PLANT, **options}
        with live.LiveSession(get_robot("biped20"), folder, **options) as session:
            yield session

    return run


@pytest.fixture
def start(live, get_robot, tmp_path, monkeypatch):
    """Starts loops on biped20 in the robot's own time, and stops them."""
    from types import SimpleNamespace

    from operators import Stepped

    from poise.apps.live._inputs import OperatorInputs
    from poise.apps.live._leads import FootLead
    from poise.apps.live._log import Takes
    from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT

    loops = []

    def make(name="biped20", plant=VELOCITY_TELEOP_PLANT, most_bytes=1 << 30, **options):
        lead = FootLead(get_robot(name), OperatorInputs(), plant, **options)
        loop = Stepped(lead, Takes(tmp_path / "takes", most_bytes=most_bytes))
        loops.append(loop)
        clock = SimpleNamespace(monotonic=lambda: loop.now)
        monkeypatch.setattr("poise.apps.live._inputs.clock", clock)
        monkeypatch.setattr("poise.apps.live._log.clock", clock)
        loop.start()
        loop.until(lambda _: True, "the first picture")
        return loop

    yield make
    for loop in loops:
        loop.stop()


@pytest.fixture(scope="module")
def play():
    """What starts the browsers of a module: its event loop ends with it."""
    from pages import playwright

    with playwright() as play:
        yield play


@pytest.fixture(scope="module")
def browser(play):
    """A browser that draws in software."""
    from pages import DRAWS_IN_SOFTWARE, chromium

    with chromium(play, *DRAWS_IN_SOFTWARE) as browser:
        yield browser


@pytest.fixture(scope="module")
def plain_browser(play):
    """A browser that draws nothing in 3D, and is quick."""
    from pages import DRAWS_NOTHING, chromium

    with chromium(play, *DRAWS_NOTHING) as browser:
        yield browser


@pytest.fixture
def desk():
    """Of a robot that stands still."""
    from still import Still

    return Still()


@pytest.fixture
def still_front(live, desk):
    """The way in, with that robot behind it, of which there is nothing to draw."""
    from poise.apps.live._front import Front

    made = Front(desk, port=0, shapes={"bodies": 0, "geometries": [], "meshes": []})
    made.start()
    yield made
    made.stop()
