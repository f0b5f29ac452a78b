"""What the tests of the live page share: sessions, and clients that are no browser."""

import json
import time
from contextlib import contextmanager

import msgspec
import numpy as np
from websockets.sync.client import connect

PATIENCE = 60.0
"""How long a loaded machine may take [s]."""


def wait_for(happened, what, patience=PATIENCE):
    """What `happened` returns as soon as that is true."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        found = happened()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError(f"waited in vain for {what}")


@contextmanager
def control(front, token=None, **options):
    """A client of the command channel, past the greeting: (socket, greeting)."""
    query = "" if token is None else f"?token={token}"
    url = f"ws://127.0.0.1:{front.port}/control{query}"
    with connect(url, proxy=None, max_queue=None, **options) as socket:
        yield socket, json.loads(socket.recv(timeout=PATIENCE))


@contextmanager
def drawing(front, key=None, **options):
    """A client of the drawing."""
    query = "" if key is None else f"?key={key}"
    url = f"ws://127.0.0.1:{front.port}/scene{query}"
    with connect(
        url, proxy=None, max_size=None, max_queue=None, subprotocols=["viser-v1.1.1"], **options
    ) as socket:
        yield socket


def beat(socket, **pad):
    socket.send(json.dumps({"beat": time.monotonic(), **pad}))


def answer(socket):
    """The next message that is no status."""
    while True:
        message = json.loads(socket.recv(timeout=PATIENCE))
        if "driven" not in message:
            return message


def drag(socket, kind, name="/hands/right", **more):
    """A message of viser's handles."""
    message = {"type": f"TransformControls{kind}Message", "name": name, "owner": "", **more}
    socket.send(msgspec.msgpack.encode(message))


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
    return skipped >= 0 and np.array_equal(run.log.velocity[skipped:], heard)
