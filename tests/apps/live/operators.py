"""What the tests of the live page share: sessions, and clients that are no browser."""

import json
import time
from contextlib import contextmanager

import numpy as np
from websockets.sync.client import connect

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


def drive(loop, sample, until, what):
    """Hold keys until something is seen."""

    def seen():
        loop.lead.inputs.take(sample)
        return until(loop.snapshot)

    wait_for(seen, what)


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
