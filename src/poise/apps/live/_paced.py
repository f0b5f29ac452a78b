"""`PacedConnection`: a connection of which a bounded number of frames is read in a second.

Robot and page share one interpreter: reading takes time from the robot. Frames (messages, parts of
messages, pings) beyond a `ReadingPace` wait unread, in the end at the sender; a connection that
keeps that up is closed with the reason.
"""

import asyncio
from typing import Any, NamedTuple, cast

from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode


class ReadingPace(NamedTuple):
    """Rate at which a connection is read."""

    rate: float  # of frames [1/s]
    burst: int  # frames in one go, and messages that wait for their answer
    piece: int  # length of one read [bytes]
    too_fast: str  # reason for closing, in 123 bytes at most


# The newest message counts in a tick of 2 ms. Devices send a thousand a second, and more after a
# stall.
DRIVES = ReadingPace(
    3000.0, 24, 4096, "More messages than can be read, for 4 s: send 1000 a second."
)
WATCHES = ReadingPace(
    20.0, 1, 256, "You are watching, and send and send: nothing of it moves the robot."
)
# Flood that closes [s]: what piled up while a line was down is read in a second or two.
FLOODS = 4.0
_MOST_SOCKETS = 200  # open connections, whatever they are for
_TOO_MANY = b"Too many connections are open here: close some."


class PacedConnection(ServerConnection):
    """A connection that is read at its `pace`; the server's own flow control has to be off."""

    pace = WATCHES  # until it has the operator's seat
    _ending: asyncio.Task[None] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to read, or end where there are too many connections."""
        super().connection_made(transport)
        self._allowed, self._read_at, self._crowded = 1.0, self.loop.time(), 0.0
        self._go_on()
        if len(self.server.handler_tasks) > _MOST_SOCKETS:
            head = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: %d"
            self.transport.write(head % len(_TOO_MANY) + b"\r\n\r\n" + _TOO_MANY)
            self.transport.close()

    def process_event(self, event: Any) -> None:
        """Count a frame, and hand it on."""
        self._allowed -= 1.0
        super().process_event(event)

    def data_received(self, data: bytes) -> None:
        """Store the received data; continue reading at the allowed rate."""
        super().data_received(data)
        self._go_on()

    def _go_on(self) -> None:
        """Read on, or rest until the pace allows it; close after too long a flood."""
        pace, transport, now = self.pace, self.transport, self.loop.time()
        if transport.is_closing():
            return
        passed, self._read_at = now - self._read_at, now
        # All of the time since the last look was spent in a rest, or none of it.
        self._crowded = max(0.0, self._crowded + (-passed if transport.is_reading() else passed))
        if self._crowded > FLOODS and self._ending is None:
            closing = self.close(CloseCode.POLICY_VIOLATION, pace.too_fast)
            self._ending = self.loop.create_task(closing)
        self._allowed = min(self._allowed + pace.rate * passed, float(pace.burst))
        cast("Any", transport).max_size = pace.piece
        if self._allowed >= 0.0 and len(self.recv_messages.frames) < pace.burst:
            transport.resume_reading()
        else:
            transport.pause_reading()
            self.loop.call_later(max(0.002, (1.0 - self._allowed) / pace.rate), self._go_on)
