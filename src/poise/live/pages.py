"""The pages that `Front` serves, and how it answers."""

from http import HTTPStatus
from importlib.resources import files
from pathlib import Path

import viser
from websockets.datastructures import Headers
from websockets.http11 import Response

# viser's own panel could open a tunnel to the internet; without it there is nothing to press.
_HIDE_PANEL = (
    "[data-floating-window],[data-dock-group],.mantine-Paper-root,.mantine-Notifications-root"
    "{display:none!important}"
)


def operator_page() -> str:
    """The page around the drawing: one document, with its style and script inside."""
    assets = files("poise.live").joinpath("assets")

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
