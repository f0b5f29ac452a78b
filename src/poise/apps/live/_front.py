"""`Front`: server on 127.0.0.1 of the page and its one channel, for operators and watchers.

- `GET /` and the files beside it: the page, which draws the robot by itself.
- `GET /shapes.json`: shapes of the robot.
- `/control`: a WebSocket. Out comes the status, with the pose of every body; in go the operator's
  orders. A connection that shows the token gets the operator's seat if that is free, and has it
  until it closes, or until it has been silent and another one comes that shows the token. Messages
  of any other connection are refused and dropped. Frames read of each, and their number, are
  bounded: sending takes no more than a part of the robot's time.
- `GET /takes/NAME`: recordings, with the token.

A request under a foreign host name (one that resolves to this machine) or from a page of another
origin gets nothing, whatever it asks for and shows.
"""

import asyncio
import secrets
import socket
import threading
import time as clock
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import msgspec
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers, MultipleValuesError
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from poise.apps.live._loop import STATUS_PERIOD
from poise.apps.live._paced import DRIVES, WATCHES, PacedConnection
from poise.apps.report import asset
from poise.errors import ConfigurationError, PoiseError

if TYPE_CHECKING:
    from poise.apps.live._session import LiveSession

HOST = "127.0.0.1"
_FILES = ("page.html", "page.css", "page.js", "body.js", "view.js")
_KINDS = {"html": "text/html", "css": "text/css", "js": "text/javascript", "json": "text/json"}
_HEADERS = {
    "Cache-Control": "no-store",
    "Connection": "close",
    # The address holds the token.
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": "default-src 'self'; img-src data:; frame-ancestors 'none'; "
    "connect-src 'self' ws://127.0.0.1:* ws://localhost:*; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
}
_MOST_WATCHERS = 32
_KEPT_FREE = 8  # more connections for the token, so that watchers do not block the operator
_FULL = f"There are {_MOST_WATCHERS} who look on already, and no more can: close another page."
_NOT_YOU = {"error": "You are watching: nothing that this page sends moves the robot."}
_TOO_LATE = (
    "You were silent, and somebody else drives now: you can watch. Reload the page when they have "
    "left."
)

SILENT_FOR = 5.0  # silence after which the operator's seat is free for others [s]
_NO_TOKEN = (
    "The token in the address is wrong, or of an earlier run: you can watch, not drive. The "
    "address for driving was printed when this run began."
)
_TAKEN = "Somebody else is driving: you can watch. Reload the page when they have left."

Answer = dict[str, Any] | None  # to a message


class PortInUseError(PoiseError):
    """Something else listens on the port."""


@dataclass(frozen=True, slots=True, eq=False)
class Grant:
    """Rights of one connection; no other equals it."""

    drives: bool  # it came with the operator's seat
    reason: str = ""  # why one with a token only watches


class Seat:
    """Lease of the operator; a silent one loses it only when another one with the token comes."""

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(16)
        self._holder: Grant | None = None
        self._heard_at = 0.0

    @property
    def taken(self) -> bool:
        """True where there is an operator that was not silent for long."""
        return self._holder is not None and clock.monotonic() - self._heard_at <= SILENT_FOR

    def enter(self, token: str | None) -> Grant:
        """Grant a new connection its rights, by its token or None to watch."""
        if token is None or not self.shows(token):
            return Grant(False, "" if token is None else _NO_TOKEN)
        if self.taken:
            return Grant(False, _TAKEN)
        self._holder, self._heard_at = Grant(True), clock.monotonic()
        return self._holder

    def hears(self, grant: Grant) -> bool:
        """Note a sign of life; return whether the grant is the operator's."""
        holds = grant is self._holder
        if holds:
            self._heard_at = clock.monotonic()
        return holds

    def shows(self, token: str) -> bool:
        """Return whether a token is the right one."""
        return secrets.compare_digest(token.encode(), self.token.encode())

    def leave(self, grant: Grant) -> bool:
        """End a grant; return whether it was the operator's, whose seat is free then."""
        held = grant is self._holder
        if held:
            self._holder = None
        return held


class Front:
    """Server on 127.0.0.1 with the page and one channel."""

    def __init__(self, desk: "LiveSession", *, port: int, shapes: dict[str, Any]) -> None:
        self._desk = desk
        self.seat = Seat()
        # A reconnected page compares it with the robot that it has drawn.
        self._name = secrets.token_urlsafe(8)
        self._pages = _pages(shapes)
        self._socket = _listen(port)
        self.port = int(self._socket.getsockname()[1])
        self._loop = asyncio.new_event_loop()
        self._ready, self._stopped = threading.Event(), asyncio.Event()
        self._told, self._told_at = "", -1.0
        self._tasks = set[asyncio.Task[None]]()
        self._open = 0
        self._thread = threading.Thread(target=self._run, name="poise front", daemon=True)

    @property
    def watch_url(self) -> str:
        """Address for watching."""
        return f"http://{HOST}:{self.port}/"

    @property
    def drive_url(self) -> str:
        """Address for driving: keep it to yourself."""
        return f"{self.watch_url}?token={self.seat.token}"

    def start(self) -> None:
        """Start to answer."""
        self._thread.start()
        self._ready.wait()

    def stop(self) -> None:
        """Close all connections."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stopped.set)
            self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        async with serve(
            self._connected,
            sock=self._socket,
            process_request=self._requested,
            compression=None,
            max_size=65536,
            max_queue=None,
            create_connection=PacedConnection,
            close_timeout=1.0,
            ping_interval=5.0,
            ping_timeout=10.0,
        ):
            self._ready.set()
            await self._stopped.wait()
        await asyncio.gather(*self._tasks)

    # Pages ---------------------------------------------------------------------------------------

    async def _requested(self, _: ServerConnection, request: Request) -> Response | None:
        """Answer a request; None lets it on to the channel."""
        try:
            host, origin = (request.headers.get(name) for name in ("Host", "Origin"))
            path = urlsplit(request.path).path
        except (ValueError, MultipleValuesError):
            return _answer(HTTPStatus.BAD_REQUEST, b"This is no request that a browser makes.")
        if not is_local(host):
            return _answer(HTTPStatus.FORBIDDEN, b"This server is for this machine only.")
        if not is_same_origin(origin, host):
            return _answer(HTTPStatus.FORBIDDEN, b"Pages of another origin are refused.")
        if path == "/control":
            return None
        if path in self._pages:
            return _answer(HTTPStatus.OK, *self._pages[path])
        if path.startswith("/takes/"):
            return await self._download(path.removeprefix("/takes/"), _token(request))
        return _answer(HTTPStatus.NOT_FOUND, b"No such page.")

    async def _download(self, name: str, token: str | None) -> Response:
        if token is None or not self.seat.shows(token):
            return _answer(HTTPStatus.FORBIDDEN, b"Recordings are for the operator.")
        path = self._desk.file(name)
        if path is None:
            return _answer(HTTPStatus.NOT_FOUND, b"No such recording.")
        # Of hours it is so long that the operator would seem to be silent meanwhile.
        body = await asyncio.to_thread(path.read_bytes)
        return _answer(HTTPStatus.OK, body, "application/octet-stream")

    # The channel ---------------------------------------------------------------------------------

    async def _connected(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        assert isinstance(connection, PacedConnection)
        token = _token(connection.request)
        kept = _KEPT_FREE if token is not None and self.seat.shows(token) else 0
        if self._open >= _MOST_WATCHERS + kept:
            await connection.close(CloseCode.TRY_AGAIN_LATER, _FULL)
            return
        self._open += 1
        grant = self.seat.enter(token)
        if grant.drives:
            connection.pace = DRIVES
            # A silent operator loses control.
            self._desk.left()
        telling = asyncio.create_task(self._tell(connection, grant))
        try:
            with suppress(ConnectionClosed):
                await self._hear(connection, grant)
        finally:
            self._open -= 1
            telling.cancel()
            if self.seat.leave(grant):
                self._desk.left()

    def _hello(self, *, drives: bool, reason: str) -> str:
        hello = "operator" if drives else "watcher"
        return _json({"hello": hello, "reason": reason, "run": self._name})

    async def _tell(self, connection: ServerConnection, grant: Grant) -> None:
        """Greet, and send the status for ever; to one that does not keep up less often."""
        with suppress(ConnectionClosed):
            await connection.send(self._hello(drives=grant.drives, reason=grant.reason))
            while True:
                await connection.send(self._status())
                await asyncio.sleep(STATUS_PERIOD)

    async def _hear(self, connection: PacedConnection, grant: Grant) -> None:
        """Carry out messages for as long as the connection is the operator's."""
        drives = grant.drives
        async for text in connection:
            if self.seat.hears(grant):
                reply = _obey(self._desk.order, text)
            else:
                if drives:
                    drives, connection.pace = False, WATCHES
                    await connection.send(self._hello(drives=False, reason=_TOO_LATE))
                reply = _NOT_YOU
            if callable(reply):
                task = asyncio.create_task(self._carry_out(connection, reply))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
            elif reply is not None:
                await connection.send(_json(reply))

    async def _carry_out(self, connection: ServerConnection, work: Callable[..., Any]) -> None:
        answer = await asyncio.to_thread(_obey, work)
        if answer is not None:
            with suppress(ConnectionClosed):
                await connection.send(_json(answer))

    def _status(self) -> str:
        """The status, encoded once for all pages that ask at about the same time."""
        now = self._loop.time()
        if now - self._told_at > 0.5 * STATUS_PERIOD:
            self._told = _json(self._desk.status() | {"driven": self.seat.taken})
            self._told_at = now
        return self._told


def is_local(host: str | None) -> bool:
    """Return whether a Host header names this machine, not a foreign name that resolves to it."""
    try:
        return host is not None and urlsplit(f"//{host}").hostname in (
            "127.0.0.1",
            "localhost",
            "::1",
        )
    except ValueError:
        return False


def is_same_origin(origin: str | None, host: str | None) -> bool:
    """Accept connections of this server's own page, and those of no page."""
    return origin is None or (is_local(host) and origin == f"http://{host}")


def _obey(work: Callable[..., Any], *arguments: Any) -> Any:
    try:
        return work(*arguments)
    except PoiseError as error:
        return {"error": str(error)}


def _pages(shapes: dict[str, Any]) -> dict[str, tuple[bytes, str]]:
    """Text and MIME type by path."""
    own = files("poise.apps.live").joinpath("assets")
    texts = {name: own.joinpath(name).read_text(encoding="utf-8") for name in _FILES}
    texts |= {name: asset(name) for name in ("three.bundle.min.js", "scene.js")}
    texts["shapes.json"] = _json(shapes)
    kinds = {name: _KINDS[name.rpartition(".")[2]] + "; charset=utf-8" for name in texts}
    found = {f"/{name}": (text.encode(), kinds[name]) for name, text in texts.items()}
    return found | {"/": found["/page.html"]}


def _answer(status: HTTPStatus, body: bytes, kind: str = "text/plain") -> Response:
    headers = Headers(_HEADERS | {"Content-Type": kind, "Content-Length": str(len(body))})
    return Response(status.value, status.phrase, headers, body)


def _token(request: Request) -> str | None:
    return parse_qs(urlsplit(request.path).query).get("token", [None])[0]


def _json(message: dict[str, Any]) -> str:
    # Not the standard library's: a browser cannot read its NaN.
    return msgspec.json.encode(message).decode()


def _listen(port: int) -> socket.socket:
    if not 0 <= port <= 65535:
        raise ConfigurationError("no such port", got=port, wanted="0 to 65535")
    try:
        return socket.create_server((HOST, port))
    except OSError as error:
        raise PortInUseError(
            f"cannot listen on port {port} ({error.strerror})",
            wanted="another with --port, or 0 for any that is free",
        ) from None
