"""Strangers, who sends without end, and those who are too many: none takes the robot's time."""

import json
import socket
import time
from contextlib import ExitStack, contextmanager, suppress

import msgspec
import pytest

pytest.importorskip("websockets")

from operators import PATIENCE, control, wait_for
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.frames import Opcode

from poise.apps.live import _front as fronts, _paced as paced

MESSAGE, PART, PING = Opcode.TEXT, Opcode.CONT, Opcode.PING
DRIVE = b'{"do": "drive"}'


def frame(opcode, content, last=True):
    """One frame, as a client sends it, masked by zeros."""
    return bytes([opcode | 0x80 * last, 0x80 | len(content)]) + bytes(4) + content


def flood(client, frames, seconds=PATIENCE):
    """Sends frames over and over, until the connection ends or time is up.

    Past the client's own book-keeping, which is slower than whoever wants to be a nuisance.
    """
    end = time.monotonic() + seconds
    client.socket.settimeout(0.1)
    with suppress(OSError):
        while time.monotonic() < end and client.close_code is None:
            with suppress(TimeoutError):
                client.socket.send(100 * frames)


def end_of(client):
    """The code with which the other end closes a connection, when it does."""
    wait_for(lambda: client.close_code is not None, "the end of the connection")
    return client.close_code


def test_of_a_driver_who_floods_no_more_is_read_than_the_pace_says_and_the_connection_ends(
    still_front, desk, monkeypatch
):
    monkeypatch.setattr(paced, "FLOODS", 1.5)
    begin = time.monotonic()
    with control(still_front, still_front.seat.token, close_timeout=1.0) as (client, hello):
        assert hello["hello"] == "operator"
        flood(client, frame(MESSAGE, DRIVE))
        assert end_of(client) == 1008
        took = time.monotonic() - begin
        assert "More messages than can be read" in client.close_reason
    most = paced.DRIVES.rate * (took + 1.0)
    # Closed once there were enough of them, and not before.
    assert 1000 < len(desk.orders) <= most
    assert took > paced.FLOODS
    wait_for(lambda: not still_front.seat.taken, "the empty seat")


@pytest.mark.parametrize("together", [1, 3000])
def test_a_thousand_a_second_are_heard_and_what_has_piled_up_on_the_line(
    still_front, desk, together
):
    with control(still_front, still_front.seat.token) as (client, _):
        begin = time.monotonic()
        for sent in range(0, 3000, together):
            time.sleep(max(0.0, begin + sent / 1000 - time.monotonic()))
            client.socket.sendall(together * frame(MESSAGE, DRIVE))
        wait_for(lambda: len(desk.orders) == 3000, "the last of them")
        assert client.close_code is None


@pytest.mark.parametrize("kind", [MESSAGE, PART, PING])
def test_a_watcher_who_floods_is_hardly_read_and_the_connection_ends(
    still_front, desk, kind, monkeypatch
):
    monkeypatch.setattr(paced, "FLOODS", 1.5)
    beats, told = [], still_front._status

    def tell():
        beats.append(time.monotonic())
        return told()

    still_front._status = tell
    with control(still_front, close_timeout=1.0) as (client, _):
        if kind is PART:
            client.socket.sendall(frame(MESSAGE, b"", last=False))
        begin = time.monotonic()
        flood(client, frame(kind, b"x", last=kind is not PART))
        assert end_of(client) == 1008
        took = time.monotonic() - begin
        assert "You are watching" in client.close_reason
        refused = 0
        with suppress(ConnectionClosed):
            while True:
                refused += "error" in json.loads(client.recv(timeout=PATIENCE))
    assert desk.orders == []
    # More come in one piece with a message that may be read, and take the beats after it.
    assert refused <= took * paced.WATCHES.rate + paced.WATCHES.piece / len(frame(kind, b"x")) + 1
    assert (refused > 0) is (kind is MESSAGE)
    # Meanwhile the page was served as ever.
    assert sum(begin < at < begin + took for at in beats) > took / (3.0 * fronts.STATUS_PERIOD)


def test_so_many_may_look_on_and_no_more_and_who_has_the_token_comes_in(still_front):
    with ExitStack() as crowd:
        for _ in range(fronts._MOST_WATCHERS):
            client, hello = crowd.enter_context(control(still_front))
            assert hello["hello"] == "watcher"
        with pytest.raises(ConnectionClosed, match="There are 32 who look on already") as refused:
            crowd.enter_context(control(still_front))
        assert refused.value.rcvd.code == 1013
        with pytest.raises(ConnectionClosed, match="look on already"):
            crowd.enter_context(control(still_front, "wrong"))
        _, hello = crowd.enter_context(control(still_front, still_front.seat.token))
        assert hello["hello"] == "operator"
        for _ in range(fronts._KEPT_FREE - 1):
            crowd.enter_context(control(still_front, still_front.seat.token))
        with pytest.raises(ConnectionClosed, match="look on already"):
            crowd.enter_context(control(still_front, still_front.seat.token))
        # One goes, one comes.
        client.close()
        wait_for(lambda: still_front._open < fronts._MOST_WATCHERS + 8, "the room")
        crowd.enter_context(control(still_front, still_front.seat.token))


def test_connections_that_ask_for_nothing_are_bounded_too(still_front, monkeypatch, capfd, caplog):
    monkeypatch.setattr(paced, "_MOST_SOCKETS", 20)
    address = "127.0.0.1", still_front.port
    with ExitStack() as crowd:
        for _ in range(20):
            crowd.enter_context(socket.create_connection(address, timeout=PATIENCE))
        with socket.create_connection(address, timeout=PATIENCE) as one_more:
            said = b""
            while piece := one_more.recv(4096):
                said += piece
    assert said.startswith(b"HTTP/1.1 503 ")
    assert said.endswith(b"Too many connections are open here: close some.")

    def comes_in():
        try:
            with control(still_front) as (_, hello):
                return hello["hello"] == "watcher"
        except (OSError, WebSocketException, AssertionError):
            # The client asserts that nobody has answered before it has asked.
            return False

    wait_for(comes_in, "the room")
    # The client's own library logs a socket that was closed under it.
    server = [record for record in caplog.records if record.name != "websockets.client"]
    assert not [record for record in server if record.exc_info]
    assert "Traceback" not in capfd.readouterr().err


ORDERS = (
    (Opcode.BINARY, msgspec.msgpack.encode({"type": "ShareUrlRequest"})),
    (MESSAGE, b'{"do": "reset"}'),
    (MESSAGE, b'{"do": "push", "value": "left"}'),
    (MESSAGE, b'{"do": "drive", "lift": [true, true]}'),
)
"""Messages that strangers send together with their handshake, before any answer.

A page on the web can open a WebSocket to any port of this machine and send without waiting.
"""
ORIGINS = ("http://evil.example", "null", "http://localhost:1", None)


@contextmanager
def first_line(port, path, origin):
    """Send handshake and orders in one go, and read the first line of the answer."""
    lines = [
        f"GET {path} HTTP/1.1",
        f"Host: 127.0.0.1:{port}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version: 13",
        *([] if origin is None else [f"Origin: {origin}"]),
    ]
    orders = b"".join(frame(*order) for order in ORDERS)
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as stranger:
        stranger.sendall("\r\n".join([*lines, "", ""]).encode() + orders)
        yield stranger.recv(4096).split(b"\r\n")[0].decode()


@pytest.mark.parametrize("origin", ORIGINS)
@pytest.mark.parametrize("path", ["/", "/control", "/control?token=wrong", "/takes/x"])
def test_of_what_strangers_send_with_their_handshake_nothing_is_carried_out(
    still_front, desk, path, origin
):
    desk.order = desk.orders.append
    with first_line(still_front.port, path, origin) as answered:
        if origin is not None:
            # Refused before there is a connection that could say anything.
            assert " 403 " in answered
        else:
            assert (" 101 " in answered) is path.startswith("/control")
    # Whoever drives is heard after it, and in the same way.
    own = f"http://127.0.0.1:{still_front.port}"
    token = still_front.seat.token
    with first_line(still_front.port, f"/control?token={token}", own) as answered:
        assert " 101 " in answered
        wait_for(lambda: len(desk.orders) >= len(ORDERS), "the operator's orders")
        assert len(desk.orders) == len(ORDERS)
