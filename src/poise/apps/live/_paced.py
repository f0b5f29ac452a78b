"""`PacedConnection`: a connection of which so much is read in a second, however much comes.

Robot and page share one interpreter: reading takes time from the robot. No more frames (messages,
parts of messages, pings) are read than a `ReadingPace` allows. Faster ones wait unread, in the end
at the sender; a connection that keeps that up is closed with the reason.
"""

import asyncio
import math
from typing import Any, NamedTuple, cast

from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode


class ReadingPace(NamedTuple):
    """Rate at which a connection is read."""

    rate: float  # of frames [1/s]
    burst: float  # frames in one look, at most
    rest: float  # from one look to the next, once a burst is used up [s]
    too_fast: str  # reason for closing, in 123 bytes at most


# The newest message counts in a tick of 2 ms. Devices send a thousand a second, and more after a
# stall.
DRIVES = ReadingPace(
    3000.0, 24.0, 0.002, "More messages than can be read, for 4 s: send 1000 a second."
)
WATCHES = ReadingPace(
    20.0, 1.0, 0.05, "You are watching, and send and send: nothing of it moves the robot."
)
FLOODS = (
    4.0  # flood that closes [s]: what piled up while a line was down is read in a second or two
)
_PIECE = 256  # read before frames are counted anew [bytes]: some forty at most
_MOST_SOCKETS = 200  # open connections, whatever they are for
_TOO_MANY = b"Too many connections are open here: close some."


class PacedConnection(ServerConnection):
    """A connection that is read at its `pace`."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.pace = DRIVES
        self._unread = bytearray()
        self._allowed, self._read_at, self._crowded = 0.0, -math.inf, 0.0
        self._resting: asyncio.TimerHandle | None = None
        self._ending: asyncio.Task[None] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to read, or end where there are too many connections."""
        self._valve = _Valve(cast("asyncio.Transport", transport))
        # It is one but for the two methods that it adds to.
        super().connection_made(cast("asyncio.Transport", self._valve))
        if len(self.server.handler_tasks) > _MOST_SOCKETS:
            head = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: %d"
            self.transport.write(head % len(_TOO_MANY) + b"\r\n\r\n" + _TOO_MANY)
            self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """Drop what is unread."""
        self._unread.clear()
        if self._resting is not None:
            self._resting.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take what has come, and read of it what the pace allows."""
        self._unread += data
        if self._resting is None:
            self._read(waited=False)

    def process_event(self, event: Any) -> None:
        """Count a frame, and hand it on."""
        self._allowed -= 1.0
        super().process_event(event)

    def _read(self, *, waited: bool) -> None:
        """Read what is allowed by now, and rest; close after too long a flood."""
        pace, now = self.pace, self.loop.time()
        passed = now - self._read_at
        self._crowded = max(0.0, self._crowded + (passed if waited else -passed))
        if self._crowded > FLOODS and self._ending is None:
            ending = self.close(CloseCode.POLICY_VIOLATION, pace.too_fast)
            self._ending = self.loop.create_task(ending)
        self._allowed = min(self._allowed + pace.rate * passed, pace.burst)
        self._read_at = now
        while self._unread and self._allowed > 0.0 and not self._valve.full:
            piece = bytes(self._unread[:_PIECE])
            del self._unread[:_PIECE]
            super().data_received(piece)
        # As much as a rest would bring: without one, the loop has a wake-up less.
        spare = self._allowed - pace.rate * pace.rest
        if spare >= 0.0 and not self._unread:
            self._allowed = spare
            self._valve.turn(held=False)
            return
        # In one piece there may be more than was allowed: that takes its time afterwards.
        rest = max(pace.rest, (1.0 - self._allowed) / pace.rate)
        self._valve.turn(held=True)
        self._resting = self.loop.call_at(now + rest, self._go_on)

    def _go_on(self) -> None:
        self._resting = None
        if self._unread:
            self._read(waited=True)
        else:
            self._valve.turn(held=False)


class _Valve:
    """A transport that reads while neither its reader is full nor the pace holds it."""

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport = transport
        self.full = self._held = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def pause_reading(self) -> None:
        """Note that the reader is full."""
        self.turn(full=True)

    def resume_reading(self) -> None:
        """Note that the reader has room."""
        self.turn(full=False)

    def turn(self, *, full: bool | None = None, held: bool | None = None) -> None:
        """Change what keeps the transport from reading."""
        self.full = self.full if full is None else full
        self._held = self._held if held is None else held
        if self.full or self._held:
            self._transport.pause_reading()
        else:
            self._transport.resume_reading()
