"""A person at the controls: the simulated robot in real time, and a page to drive it from."""

from importlib.util import find_spec

from poise.errors import MissingExtraError

if find_spec("viser") is None:
    raise MissingExtraError("viser", "teleop", "Live teleoperation")

from poise.live.gamepad import HostGamepad
from poise.live.hands import LiveHands
from poise.live.inputs import OperatorInputs, Pad
from poise.live.loop import LiveLoop
from poise.live.session import LiveSession
from poise.live.snapshot import Snapshot
from poise.live.takes import Takes

__all__ = [
    "HostGamepad",
    "LiveHands",
    "LiveLoop",
    "LiveSession",
    "OperatorInputs",
    "Pad",
    "Snapshot",
    "Takes",
]
