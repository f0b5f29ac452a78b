"""`Front`: the only way in. It serves the page, and tells operators from watchers.

Everything that a browser gets comes from one origin on 127.0.0.1, through the public API of
`websockets` alone:

- `GET /` and the files beside it: the page. It draws the robot by itself, with the three.js and the
  code that reports carry for their replay, so there is no second server that would want a guard.
- `GET /shapes.json`: what the robot looks like, once.
- `/control`: a WebSocket. Out of it comes the status, with the pose of every body; into it goes
  what the operator does. A connection that shows the token gets the operator's seat if that is
  free, and has it until it closes, or until it has been silent and somebody else comes who shows
  the token. What any other connection sends is refused and dropped. How much is read of each, and
  how many there may be, is bounded: by sending nobody takes more than a part of the robot's time.
- `GET /takes/NAME`: recordings, with the token.

A request under a foreign host name (one of somebody else's that resolves to this machine) or from a
page of another origin gets nothing, whatever it asks for and whatever it shows.
"""

import asyncio
import secrets
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable
from urllib.parse import parse_qs, urlsplit

import msgspec
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers, MultipleValuesError
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from poise.apps.live._paced import DRIVES, WATCHES, PacedConnection
from poise.apps.live._seat import Grant, Seat, is_local, is_same_origin
from poise.apps.report import asset
from poise.errors import ConfigurationError, PoiseError

HOST = "127.0.0.1"
STATUS_PERIOD = 0.04
"""Time from one status to the next [s]."""

_LONGEST = 65536
"""Longest message that a page may send [bytes]."""

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
_PING = 5.0
"""Every so often [s] a connection has to show that it is there, within twice as long."""

_TOO_LATE = (
    "You were silent, and somebody else drives now: you can watch. Reload the page when they have "
    "left."
)
_MOST_WATCHERS = 32
"""That there may be."""

_KEPT_FREE = 8
"""So many more there may be of those who have the token: watchers keep nobody from driving."""

_FULL = f"There are {_MOST_WATCHERS} who look on already, and no more can: close another page."

_NOT_YOU = {"error": "You are watching: nothing that this page sends moves the robot."}


Answer = dict[str, Any] | None
"""What a page gets for a message; None for nothing."""

_Reply = TypeVar("_Reply")


class PortInUseError(PoiseError):
    """Something else listens on the port."""


@runtime_checkable
class Desk(Protocol):
    """What stands behind `Front`: all commands come here, and only from the operator."""

    def order(self, text: str | bytes) -> Answer | Callable[[], Answer]:
        """Carries out a message of the operator's page; an answer for that page.

        Or what is still to be done for it, which may take a while: it is called in another thread,
        so that the operator's next messages do not wait for it.
        """
        ...

    def left(self) -> None:
        """The operator has gone."""
        ...

    def status(self) -> dict[str, Any]:
        """What every page shows, some twenty times a second."""
        ...

    def file(self, name: str) -> Path | None:
        """A recording by its name."""
        ...


class Front:
    """A server on 127.0.0.1 with the page and one channel."""

    def __init__(self, desk: Desk, *, port: int, shapes: dict[str, Any]) -> None:
        self._desk = desk
        self.seat = Seat()
        # A page that comes back knows by it whether it is still the robot that it has drawn.
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
        """Starts to answer."""
        self._thread.start()
        self._ready.wait()

    def stop(self) -> None:
        """Closes all connections."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stopped.set)
            self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        self._loop.run_until_complete(self._serve())
        if self._tasks:
            self._loop.run_until_complete(asyncio.wait(self._tasks))
        self._loop.run_until_complete(self._loop.shutdown_default_executor())
        self._loop.close()

    async def _serve(self) -> None:
        async with serve(
            self._connected,
            sock=self._socket,
            process_request=self._requested,
            compression=None,
            max_size=_LONGEST,
            create_connection=PacedConnection,
            close_timeout=1.0,
            ping_interval=_PING,
            ping_timeout=2.0 * _PING,
        ):
            self._ready.set()
            await self._stopped.wait()

    # Pages ---------------------------------------------------------------------------------------

    async def _requested(self, _: ServerConnection, request: Request) -> Response | None:
        """What a request gets; None lets it on to the channel."""
        try:
            return await self._answered(request)
        except (ValueError, MultipleValuesError):
            return _answer(HTTPStatus.BAD_REQUEST, b"This is no request that a browser makes.")

    async def _answered(self, request: Request) -> Response | None:
        host = request.headers.get("Host")
        if not is_local(host):
            return _answer(HTTPStatus.FORBIDDEN, b"This server is for this machine only.")
        if not is_same_origin(request.headers.get("Origin"), host):
            return _answer(HTTPStatus.FORBIDDEN, b"Pages of another origin are refused.")
        path = urlsplit(request.path).path
        if path == "/control":
            return None
        if path in self._pages:
            body, kind = self._pages[path]
            return _answer(HTTPStatus.OK, body, kind)
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
        try:
            await self._served(connection, self.seat.enter(token))
        finally:
            self._open -= 1

    async def _served(self, connection: PacedConnection, grant: Grant) -> None:
        connection.pace = DRIVES if grant.drives else WATCHES
        if grant.drives:
            # Whoever had the seat before, and has been silent, does not drive any more.
            self._desk.left()
        telling: asyncio.Task[None] | None = None
        try:
            await connection.send(self._hello(drives=grant.drives, reason=grant.reason))
            telling = asyncio.create_task(self._tell(connection))
            await self._listen(connection, grant)
        except ConnectionClosed:
            pass
        finally:
            if telling is not None:
                telling.cancel()
            if self.seat.holds(grant):
                self.seat.leave(grant)
                self._desk.left()

    def _hello(self, *, drives: bool, reason: str) -> str:
        """What a connection is: the operator's, or somebody's who watches."""
        hello = "operator" if drives else "watcher"
        return _json({"hello": hello, "reason": reason, "run": self._name})

    async def _listen(self, connection: PacedConnection, grant: Grant) -> None:
        """Carries out what the operator's page says, as long as it is the operator's."""
        drives = grant.drives
        async for text in connection:
            if self.seat.hears(grant):
                reply = self._obey(lambda said=text: self._desk.order(said))
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

    async def _carry_out(self, connection: ServerConnection, work: Callable[[], Answer]) -> None:
        """Does what takes a while, and says what came of it."""
        answer = await asyncio.to_thread(self._obey, work)
        if answer is not None:
            with suppress(ConnectionClosed):
                await connection.send(_json(answer))

    def _obey(self, work: Callable[[], _Reply]) -> _Reply | dict[str, Any]:
        try:
            return work()
        except PoiseError as error:
            return {"error": str(error)}

    async def _tell(self, connection: ServerConnection) -> None:
        """Sends a page the status for ever; one that does not keep up gets it less often."""
        with suppress(ConnectionClosed):
            while True:
                await connection.send(self._status())
                await asyncio.sleep(STATUS_PERIOD)

    def _status(self) -> str:
        """The status, put into words once for all pages that ask at about the same time."""
        now = self._loop.time()
        if now - self._told_at > 0.5 * STATUS_PERIOD:
            self._told = _json(self._desk.status() | {"driven": self.seat.taken})
            self._told_at = now
        return self._told


def _pages(shapes: dict[str, Any]) -> dict[str, tuple[bytes, str]]:
    """What is served: text and MIME type by path."""
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
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen()
    except OSError as error:
        listener.close()
        raise PortInUseError(
            f"cannot listen on port {port} ({error.strerror})",
            wanted="another with --port, or 0 for any that is free",
        ) from None
    return listener
