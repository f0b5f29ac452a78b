"""A person at the controls: the simulated robot in real time, and a page to drive it from."""

from importlib.util import find_spec

from poise.errors import MissingExtraError

if find_spec("websockets") is None:
    raise MissingExtraError("websockets", "teleop", "Live teleoperation")

from poise.apps.live._drive import DRIVE_PLANT as DRIVE_PLANT, DriveLoop as DriveLoop
from poise.apps.live._gamepad import HostGamepad as HostGamepad
from poise.apps.live._inputs import OperatorInputs as OperatorInputs
from poise.apps.live._integrator import LiveFeet as LiveFeet
from poise.apps.live._log import Takes as Takes
from poise.apps.live._loop import LiveLoop as LiveLoop
from poise.apps.live._odometry import Odometry as Odometry
from poise.apps.live._session import DriveSession, LiveSession
from poise.apps.live._snapshot import Snapshot as Snapshot

__all__ = ["DriveSession", "LiveSession"]
