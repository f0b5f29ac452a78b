"""What the tests of the live page share: sessions, and clients that are no browser."""

import json
import time
from contextlib import contextmanager

import numpy as np
from websockets.sync.client import connect

from poise.apps.live._loop import LiveLoop

PATIENCE = 60.0
"""How long a loaded machine may take [s]."""


def wait_for(happened, what, patience=PATIENCE):
    """What `happened` returns as soon as that is true."""
    found = comes(happened, patience)
    if not found:
        raise AssertionError(f"waited in vain for {what}")
    return found


def comes(happened, patience):
    """Likewise; what it returned last where that is not true in time."""
    end = time.monotonic() + patience
    while not (found := happened()) and time.monotonic() < end:
        time.sleep(0.02)
    return found


class Stepped(LiveLoop):
    """A loop whose time is the robot's: no thread, no waiting, the same in every run."""

    now = 100.0

    def start(self):
        self.takes.open()
        self.takes.expect(self.lead)

    def until(self, happened, what, sample=None):
        """Take turns, with keys held, until something is seen of the snapshot."""
        end = time.perf_counter() + PATIENCE
        while time.perf_counter() < end:
            if sample is not None:
                self.lead.inputs.take(sample)
            self.turn(self.now)
            self.now += self.plant.control_dt
            if self.snapshot is not None and happened(self.snapshot):
                return
        raise AssertionError(f"waited in vain for {what}")


@contextmanager
def control(front, token=None, **options):
    """A client of the command channel, past the greeting: (socket, greeting)."""
    query = "" if token is None else f"?token={token}"
    url = f"ws://127.0.0.1:{front.port}/control{query}"
    with connect(url, proxy=None, max_queue=None, **options) as socket:
        yield socket, json.loads(socket.recv(timeout=PATIENCE))


def beat(socket, **raw):
    """A sign of life, with keys, sticks and handles."""
    socket.send(json.dumps({"do": "drive", "time": time.monotonic(), **raw}))


def answer(socket):
    """The next message that is no status."""
    while True:
        message = json.loads(socket.recv(timeout=PATIENCE))
        if "driven" not in message:
            return message


def says(desk, what, member, *expected):
    """Wait for a message of the page whose member is as expected, if it is there at all."""

    def last():
        said = [order for order in list(desk.orders) if order["do"] == "drive"]
        return said and said[-1].get(member)

    wait_for(lambda: last() in expected, what)


def gamepad(*buttons, **axes):
    """The sample of a gamepad with buttons pressed and axes deflected, by SDL's names."""
    from poise.apps.live._gamepad import sample_from

    return sample_from(lambda name: name in buttons, lambda name: axes.get(name, 0.0))


def listen_to(loop):
    """The commands that the plant gets from now on."""
    heard, step = [], loop.plant.step

    def hear(command):
        heard.append(command.velocity.copy())
        step(command)

    loop.plant.step = hear
    return heard


def same_commands(run, heard):
    """Whether a replay gave the plant what was heard, which begins somewhere in the run."""
    heard = np.array(heard)
    skipped = len(run.log) - len(heard)
    return skipped >= 0 and np.array_equal(run.log.command[skipped:], heard)
