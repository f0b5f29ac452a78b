"""`Front`: the only way in. It serves the page, and tells operators from watchers.

The pages that `Front` serves, and how it answers.
"""

import asyncio
import json
import socket
import threading
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol, runtime_checkable
from urllib.parse import parse_qs, urlsplit

import msgspec
import viser
from websockets.asyncio.client import connect
from websockets.asyncio.server import Server, ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from poise.apps.live._scene import OPERATOR, ROLE_HEADER, SECRET_HEADER
from poise.apps.live._seat import Seat, is_local, is_same_origin
from poise.errors import ConfigurationError, PoiseError

# viser's own panel could open a tunnel to the internet; without it there is nothing to press.
_HIDE_PANEL = (
    "[data-floating-window],[data-dock-group],.mantine-Paper-root,.mantine-Notifications-root"
    "{display:none!important}"
)


def operator_page() -> str:
    """The page around the drawing: one document, with its style and script inside."""
    assets = files("poise.apps.live").joinpath("assets")

    def text(name: str) -> str:
        return assets.joinpath(name).read_text(encoding="utf-8")

    page = text("page.html").replace("/* page.css */", text("page.css"))
    return page.replace("/* page.js */", text("page.js"))


def viewer_page() -> str:
    """The page of viser, with nothing on it but the drawing."""
    assert viser.__file__ is not None
    index = Path(viser.__file__).parent / "client" / "build" / "index.html"
    page = index.read_text(encoding="utf-8")
    return page.replace("<head>", f"<head><style>{_HIDE_PANEL}</style>", 1)


def answer(status: HTTPStatus, body: str | bytes, kind: str = "text/plain") -> Response:
    """A response to a browser.

    Args:
        status: of HTTP.
        body: what it says.
        kind: its MIME type.
    """
    data = body.encode() if isinstance(body, str) else body
    headers = Headers(
        {
            "Content-Type": kind,
            "Content-Length": str(len(data)),
            "Cache-Control": "no-store",
            "Connection": "close",
            # The address holds the token.
            "Referrer-Policy": "no-referrer",
            # The drawing stands in the page under this machine's other name.
            "Content-Security-Policy": "frame-ancestors http://127.0.0.1:* http://localhost:*",
            "X-Content-Type-Options": "nosniff",
        }
    )
    return Response(status.value, status.phrase, headers, data)


HOST = "127.0.0.1"
STATUS_PERIOD = 0.05
"""Time from one status to the next [s]."""

_LONGEST = 65536
"""Longest message that a page may send [bytes]."""
_BEHIND = 1 << 20
"""A page that has not taken this much yet is left out until it has [bytes]."""

_CAMERA = "ViewerCameraMessage"
_HANDLE = "TransformControls"
"""Of viser's messages, what a watcher may send, and the beginning of what an operator may too."""


class PortInUseError(PoiseError):
    """Something else listens on the port."""


@runtime_checkable
class Desk(Protocol):
    """What stands behind `Front`: all commands come here, and only from the operator."""

    def order(self, message: dict[str, Any]) -> dict[str, Any] | None:
        """Carries out a message of the operator's page; an answer for that page."""
        ...

    def handle(self, message: dict[str, Any]) -> None:
        """What the operator did with a handle, as viser says it."""
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
    """A server on 127.0.0.1 with the page, one channel for commands and one for the drawing.

    A connection to `/control` with the token gets the operator's seat if it is free, and with it a
    key that lives as long as the connection. What comes in through `/scene` is handed on only as
    far as it moves the sender's own camera, or, with the key, a handle. A page of another origin
    gets nothing, nor does a request under a foreign host name.

    Args:
        desk: takes the commands.
        port: to listen on; 0 for any that is free.
        scene_port: where `Scene` listens.
        secret: what it wants to be shown.

    Raises:
        PortInUseError: the port is taken.
        ConfigurationError: no such port.
    """

    def __init__(self, desk: Desk, *, port: int, scene_port: int, secret: str) -> None:
        self._desk, self._scene, self._secret = desk, f"ws://{HOST}:{scene_port}", secret
        self.seat = Seat()
        self._socket = _listen(port)
        self.port = int(self._socket.getsockname()[1])
        self._pages: set[ServerConnection] = set()
        self._viewer = viewer_page()
        self._page = operator_page()
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._stopped: asyncio.Event | None = None
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
        stopped = self._stopped
        if stopped is not None:
            self._loop.call_soon_threadsafe(stopped.set)
            self._thread.join()
        self._socket.close()

    # The thread ----------------------------------------------------------------------------------

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._serve())
        self._loop.close()

    async def _serve(self) -> None:
        self._stopped = asyncio.Event()
        server: Server = await serve(
            self._connected,
            sock=self._socket,
            process_request=self._requested,
            select_subprotocol=_subprotocol,
            compression=None,
            max_size=_LONGEST,
            close_timeout=1.0,
        )
        async with server:
            telling = asyncio.create_task(self._tell())
            self._ready.set()
            await self._stopped.wait()
            telling.cancel()

    def _requested(self, _: ServerConnection, request: Request) -> Response | None:
        host = request.headers.get("Host")
        if not is_local(host):
            return answer(HTTPStatus.FORBIDDEN, "This server is for this machine only.")
        if not is_same_origin(request.headers.get("Origin"), host):
            return answer(HTTPStatus.FORBIDDEN, "Pages of another origin are refused.")
        url = urlsplit(request.path)
        if request.headers.get("Upgrade", "").lower() == "websocket":
            known = url.path in ("/control", "/scene")
            return None if known else answer(HTTPStatus.NOT_FOUND, "No such channel.")
        if url.path == "/":
            return answer(HTTPStatus.OK, self._page, "text/html; charset=utf-8")
        if url.path == "/view":
            return answer(HTTPStatus.OK, self._viewer, "text/html; charset=utf-8")
        if url.path.startswith("/takes/"):
            return self._download(url.path.removeprefix("/takes/"), _query(request, "token"))
        return answer(HTTPStatus.NOT_FOUND, "No such page.")

    def _download(self, name: str, token: str | None) -> Response:
        if token is None or not self.seat.shows(token):
            return answer(HTTPStatus.FORBIDDEN, "Recordings are for the operator.")
        path = self._desk.file(name)
        if path is None:
            return answer(HTTPStatus.NOT_FOUND, "No such recording.")
        return answer(HTTPStatus.OK, path.read_bytes(), "application/octet-stream")

    async def _connected(self, connection: ServerConnection) -> None:
        request = connection.request
        assert request is not None
        try:
            if urlsplit(request.path).path == "/control":
                await self._control(connection, request)
            else:
                await self._draw(connection, request)
        except ConnectionClosed:
            pass

    # Commands ------------------------------------------------------------------------------------

    async def _control(self, connection: ServerConnection, request: Request) -> None:
        grant = self.seat.enter(_query(request, "token"))
        hello = {
            "hello": "watcher" if grant.key is None else OPERATOR,
            "key": grant.key,
            "reason": grant.reason,
        }
        try:
            await connection.send(json.dumps(hello))
            self._pages.add(connection)
            async for text in connection:
                reply = self._obey(text) if self.seat.holds(grant.key) else _NOT_YOU
                if reply is not None:
                    await connection.send(json.dumps(reply))
        finally:
            self._pages.discard(connection)
            if self.seat.holds(grant.key):
                self.seat.leave(grant.key)
                self._desk.left()

    def _obey(self, text: str | bytes) -> dict[str, Any] | None:
        try:
            message = json.loads(text, parse_constant=_refuse)
        except (ValueError, RecursionError):
            return {"error": "this is no JSON"}
        if not isinstance(message, dict):
            return {"error": "this is no message"}
        try:
            return self._desk.order(message)
        except PoiseError as error:
            return {"error": str(error)}

    async def _tell(self) -> None:
        while True:
            status = self._desk.status() | {
                "driven": self.seat.taken,
                "pages": len(self._pages),
            }
            # One page that does not keep up shall not fill the memory.
            ready = [p for p in self._pages if p.transport.get_write_buffer_size() < _BEHIND]
            broadcast(ready, json.dumps(status))
            await asyncio.sleep(STATUS_PERIOD)

    # The drawing ---------------------------------------------------------------------------------

    async def _draw(self, connection: ServerConnection, request: Request) -> None:
        key = _query(request, "key")
        role = OPERATOR if self.seat.holds(key) else "watcher"
        chosen = connection.subprotocol
        async with connect(
            self._scene,
            subprotocols=None if chosen is None else [chosen],
            additional_headers={SECRET_HEADER: self._secret, ROLE_HEADER: role},
            compression=None,
            max_size=None,
            proxy=None,
        ) as viewer:
            back = asyncio.create_task(_pump(viewer, connection))
            try:
                async for data in connection:
                    if isinstance(data, bytes) and self._may_pass(data, key):
                        await viewer.send(data)
            finally:
                back.cancel()
                if self.seat.holds(key):
                    # A page that goes in the middle of a drag cannot say that it lets go.
                    for name in ("left", "right"):
                        self._desk.handle({"type": f"{_HANDLE}DragEndMessage", "name": name})

    def _may_pass(self, data: bytes, key: str | None) -> bool:
        """Whether viser gets a page's message; tells the desk of handles that were moved."""
        try:
            message = msgspec.msgpack.decode(data)
        except msgspec.DecodeError:
            return False
        kind = message.get("type") if isinstance(message, dict) else None
        if kind == _CAMERA:
            return True
        if not (isinstance(kind, str) and kind.startswith(_HANDLE) and self.seat.holds(key)):
            return False
        try:
            self._desk.handle(message)
        except ConfigurationError:
            return False
        return True


_NOT_YOU = {"error": "You are watching: nothing that this page sends moves the robot."}


async def _pump(source: Any, sink: ServerConnection) -> None:
    async for data in source:
        await sink.send(data)


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


def _query(request: Request, name: str) -> str | None:
    return parse_qs(urlsplit(request.path).query).get(name, [None])[0]


def _subprotocol(_: ServerConnection, offered: Any) -> Subprotocol | None:
    return next((p for p in offered if p.startswith("viser-v")), None)


def _refuse(constant: str) -> float:
    raise ValueError(constant)
