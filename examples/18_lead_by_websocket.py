"""Lead a foot from a program of your own: a tracked hand, sent as websocket messages."""

import argparse
import json
import math
import tempfile
import time
from typing import Any

from websockets.sync.client import connect

import poise
from poise.apps.live import LiveSession

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="biped20", help="a name in `poise robots`, or a file")
parser.add_argument("--steps", type=int, default=2)
options = parser.parse_args()


def hand(phase: float) -> dict[str, Any]:
    """A hand that makes a step: forward, left, up [m], from anywhere; it holds while it moves."""
    ahead = 0.06 * min(1.0, 2.0 * phase)
    up = 0.09 * math.sin(math.pi * phase) - 0.03 * phase
    return {"position": [1.0 + ahead, 0.5, 1.2 + up], "clutch": 0.02 < phase < 0.98}


with LiveSession(poise.load_robot(options.robot), tempfile.mkdtemp()) as session:
    url = f"ws://127.0.0.1:{session.front.port}/control?token={session.front.seat.token}"
    with connect(url, proxy=None) as socket:
        print("I am the", json.loads(socket.recv())["hello"])

        def newest() -> dict[str, Any]:
            """The next status; other messages answer ours with our clock, to measure latency."""
            while "time" not in (message := json.loads(socket.recv())):
                pass
            return message

        for step in range(options.steps):
            foot, status, modes = step % 2, newest(), set[str]()
            begin = status["time"]
            # In the robot's time: on a busy machine it is slower than the clock.
            while (phase := (status["time"] - begin) / 2.5) < 1.2:
                feet: list[dict[str, Any] | None] = [None, None]
                feet[foot] = hand(min(phase, 1.0))
                now = time.monotonic()
                socket.send(json.dumps({"do": "drive", "time": now, "feet": feet}))
                status = newest()
                modes.add(status["mode"])
            left, right = (sole[0] for sole in status["soles"])
            print(f"modes {sorted(modes)}; feet at {left:.2f} and {right:.2f} m")
