"""Live teleoperation: the robot simulated in real time, and a page that commands it."""

from importlib.util import find_spec

from poise.errors import MissingExtraError

if find_spec("websockets") is None:
    raise MissingExtraError("websockets", "teleop", "Live teleoperation")

from poise.apps.live._leads import WALK_PLANT as WALK_PLANT
from poise.apps.live._session import LiveSession

__all__ = ["LiveSession"]
