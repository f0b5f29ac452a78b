"""`PacedConnection`: a connection of which so much is read in a second, however much comes.

Robot and page share one interpreter: whatever is read takes its time from the robot. A message, a
part of one, a ping: each is a frame, and of frames no more are taken than a `Pace` says. What comes
faster waits unread, in the end with whoever sends it. Who keeps that up is told so, and the
connection ends.
"""

import asyncio
import math
from typing import Any, NamedTuple, cast

from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode


class Pace(NamedTuple):
    """How much of a connection is read.

    Attributes:
        rate: frames a second [1/s].
        burst: frames at once, and so in one look, at most.
        rest: from one look to the next [s].
        too_fast: what is told to who sends faster, in 123 bytes at most.
    """

    rate: float
    burst: float
    rest: float
    too_fast: str


DRIVES = Pace(3000.0, 24.0, 0.002, "More messages than can be read, for 4 s: send 1000 a second.")
"""For whoever drives, whose newest message counts in a tick of 2 ms. Devices send a thousand a
second; after a stall there is more for a while."""

WATCHES = Pace(
    20.0, 1.0, 0.05, "You are watching, and send and send: nothing of it moves the robot."
)
"""For anybody else, who has nothing to say."""

FLOODS = 4.0
"""Who has sent faster for so long [s] is told so; to read what piled up while a line was down takes
a second or two."""

_PIECE = 256
"""So much is read before frames are counted anew [bytes]: some forty at most."""

_MOST_SOCKETS = 200
"""Of connections that are open at once, whatever they are for."""

_TOO_MANY = b"Too many connections are open here: close some."


class PacedConnection(ServerConnection):
    """A connection that is read at a pace.

    Attributes:
        pace: how much of it is read.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.pace = DRIVES
        self._unread = bytearray()
        self._allowed, self._read_at = 0.0, -math.inf
        self._crowded = 0.0
        self._resting: asyncio.TimerHandle | None = None
        self._ending: asyncio.Task[None] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begins to read; where there are too many connections, says so and ends."""
        self._valve = _Valve(cast("asyncio.Transport", transport))
        # It is one but for the two methods that it adds to.
        super().connection_made(cast("asyncio.Transport", self._valve))
        if len(self.server.handler_tasks) > _MOST_SOCKETS:
            head = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: %d"
            self.transport.write(head % len(_TOO_MANY) + b"\r\n\r\n" + _TOO_MANY)
            self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """What has not been read by now never is."""
        self._unread.clear()
        if self._resting is not None:
            self._resting.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Takes what has come, as much of it as the pace lets."""
        self._unread += data
        if self._resting is None:
            self._read(waited=False)

    def process_event(self, event: Any) -> None:
        """Counts what is read, and hands it on."""
        self._allowed -= 1.0
        super().process_event(event)

    def _read(self, *, waited: bool) -> None:
        """Reads what may be read by now, and then rests."""
        pace, now = self.pace, self.loop.time()
        self._reckon(now - self._read_at if waited else self._read_at - now)
        self._allowed = min(self._allowed + pace.rate * (now - self._read_at), pace.burst)
        self._read_at = now
        while self._unread and self._allowed > 0.0 and not self._valve.full:
            piece = bytes(self._unread[:_PIECE])
            del self._unread[:_PIECE]
            super().data_received(piece)
        # In one piece there may be more than was allowed: that takes its time afterwards.
        rest = max(pace.rest, (1.0 - self._allowed) / pace.rate)
        self._valve.hold(True)
        self._resting = self.loop.call_at(now + rest, self._go_on)

    def _reckon(self, longer: float) -> None:
        """For how long there has been too much to read [s]; whoever floods is told so."""
        self._crowded = max(0.0, self._crowded + longer)
        if self._crowded > FLOODS and self._ending is None:
            ending = self.close(CloseCode.POLICY_VIOLATION, self.pace.too_fast)
            self._ending = self.loop.create_task(ending)

    def _go_on(self) -> None:
        """After a rest."""
        self._resting = None
        if self._unread:
            self._read(waited=True)
        else:
            self._valve.hold(False)


class _Valve:
    """A transport that reads while neither its reader nor the pace is against it.

    Attributes:
        full: whether its reader has enough.
    """

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport = transport
        self.full = self._held = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def pause_reading(self) -> None:
        """Its reader has enough."""
        self.full = True
        self._turn()

    def resume_reading(self) -> None:
        """Its reader has room again."""
        self.full = False
        self._turn()

    def hold(self, on: bool) -> None:
        """The pace holds it back, or lets it go."""
        self._held = on
        self._turn()

    def _turn(self) -> None:
        if self.full or self._held:
            self._transport.pause_reading()
        else:
            self._transport.resume_reading()
