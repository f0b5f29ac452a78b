"""Two arms with force feedback lead the feet: their driver, with simulated arms in hands."""

import argparse
import json
import math
import tempfile
from typing import Any

import numpy as np
from websockets.sync.client import connect

import poise
from poise.apps.live import LiveSession
from poise.apps.teleoperation import HapticDriver, SimulatedArm

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="biped20", help="a name in `poise robots`, or a file")
options = parser.parse_args()

END = 4.5


def resting(time: float) -> tuple[np.ndarray, bool]:
    """A hand that holds its arm still."""
    return np.array([0.4, 0.2, 0.1]), time > 0.3


def stepping(time: float) -> tuple[np.ndarray, bool]:
    """A hand that makes a step: forward, left, up [m], and whether it holds the clutch."""
    phase = min(1.0, max(0.0, (time - 0.8) / 3.0))
    ahead, up = 0.06 * min(1.0, 2.0 * phase), 0.09 * math.sin(math.pi * phase)
    return np.array([0.4 + ahead, -0.2, 0.1 + up - 0.03 * phase]), 0.3 < time < 4.2


# Your own arms have `read` and `write`, and a thread that calls `driver.tick` every millisecond.
arms = SimulatedArm(resting), SimulatedArm(stepping)
driver = HapticDriver(*arms)


def feet() -> list[dict[str, Any] | None]:
    """What both arms say, as the message has it."""
    said = driver.readings
    return [r and {"position": r[0].tolist(), "clutch": bool(r[1])} for r in said]


with LiveSession(poise.load_robot(options.robot), tempfile.mkdtemp()) as session:
    url = f"ws://127.0.0.1:{session.front.port}/control?token={session.front.seat.token}"
    with connect(url, proxy=None) as socket:
        begin, now, periods, forces = None, 0.0, 0, list[float]()
        message: dict[str, Any] = {}
        while now < END:
            message = json.loads(socket.recv())
            if message.get("forces"):
                # The answer to what was sent: what the feet feel now.
                driver.feel(message["forces"], now)
            elif "time" in message:
                # In the robot's time: on a busy machine it is slower than the clock.
                begin = message["time"] if begin is None else begin
                now = message["time"] - begin
                while periods * driver.dt < now:
                    driver.tick(periods * driver.dt)
                    forces.append(float(arms[1].force[2]))
                    periods += 1
                socket.send(json.dumps({"do": "drive", "time": now, "feet": feet()}))
        left, right = (sole[0] for sole in message["soles"])
        print(f"feet at {left:.2f} and {right:.2f} m")
        strongest = int(np.argmax(forces))
        print(f"the hand felt {forces[strongest]:.1f} N upwards, after {1e-3 * strongest:.1f} s")
        print(f"and {max(forces[:2000]):.1f} N in the two seconds in which the foot went up")
