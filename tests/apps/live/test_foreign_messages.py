"""What strangers send together with their handshake, before any answer: nothing of it acts.

A page on the web can open a WebSocket to any port of this machine and send at once. Viser's own
port, which an earlier page had, carried out what came so, a request for a public tunnel among it.
"""

import os
import socket
import struct
import sys
import time

import msgspec
import pytest

pytest.importorskip("websockets")

from poise.apps.live._front import Desk, Front

TRIES = 200
MESSAGES = (
    # What asks viser for a public tunnel.
    (2, msgspec.msgpack.encode({"type": "ShareUrlRequest"})),
    (1, b'{"do": "reset"}'),
    (1, b'{"do": "push", "value": "left"}'),
    (1, b'{"do": "drive", "lift": [true, true]}'),
)
"""Opcode and payload."""
PATHS = ("/", "/control", "/control?token=wrong", "/scene", "/takes/x")
ORIGINS = ("http://evil.example", "null", "http://localhost:1", None)


class Counting:
    """A desk that counts what it is told to do."""

    def __init__(self):
        self.orders = []

    def order(self, text):
        self.orders.append(text)
        return

    def left(self):
        pass

    def status(self):
        return {"time": 0.0}

    def file(self, name):
        return None


@pytest.fixture
def desk():
    return Counting()


@pytest.fixture
def front(desk):
    assert isinstance(desk, Desk)
    made = Front(desk, port=0, shapes={})
    made.start()
    yield made
    made.stop()


def frame(opcode, payload):
    """A masked frame of a client, of less than 126 bytes."""
    mask = os.urandom(4)
    masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))
    return struct.pack("!BB", 0x80 | opcode, 0x80 | len(payload)) + mask + masked


def handshake(port, path, origin):
    lines = [
        f"GET {path} HTTP/1.1",
        f"Host: 127.0.0.1:{port}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version: 13",
    ]
    if origin is not None:
        lines.append(f"Origin: {origin}")
    return "\r\n".join([*lines, "", ""]).encode()


def first_line(port, path, origin, *frames):
    """Sends handshake and frames in one go; the first line of the answer."""
    with socket.create_connection(("127.0.0.1", port), timeout=60) as stranger:
        stranger.sendall(handshake(port, path, origin) + b"".join(frames))
        return stranger.recv(4096).split(b"\r\n")[0].decode()


def test_of_200_messages_that_strangers_send_with_their_handshake_none_is_carried_out(front, desk):
    refused = 0
    for k in range(TRIES):
        path, origin = PATHS[k % len(PATHS)], ORIGINS[(k // len(PATHS)) % len(ORIGINS)]
        frames = [frame(*message) for message in MESSAGES]
        answer = first_line(front.port, path, origin, *frames)
        if origin is not None:
            # Refused before there is a connection that could say anything.
            assert "403" in answer
            refused += 1
        else:
            assert "101" not in answer or path.startswith("/control")
    # A connection without an origin is no page; it may watch, and is not listened to.
    time.sleep(0.3)
    assert refused == TRIES * 3 // 4
    assert desk.orders == []
    assert not front.seat.taken
    assert not any(name.split(".")[0] == "viser" for name in sys.modules)


def test_the_same_messages_are_heard_from_whoever_drives(front, desk):
    path = f"/control?token={front.seat.token}"
    own = f"http://127.0.0.1:{front.port}"
    with socket.create_connection(("127.0.0.1", front.port), timeout=60) as operator:
        operator.sendall(
            handshake(front.port, path, own) + b"".join(frame(*message) for message in MESSAGES)
        )
        end = time.monotonic() + 60.0
        while len(desk.orders) < len(MESSAGES):
            assert time.monotonic() < end
            time.sleep(0.01)
