"""`Seat`: who may command the robot. One operator at most, and only with the token."""

import secrets
import threading
from dataclasses import dataclass
from urllib.parse import urlsplit

_LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True)
class Grant:
    """What somebody who came may do.

    Attributes:
        key: proof of being the operator; None for a watcher.
        reason: why somebody with a token only watches.
    """

    key: str | None
    reason: str = ""


class Seat:
    """The operator's seat.

    A key is good until its holder leaves, so what an operator of before still sends is nobody's.

    Attributes:
        token: whoever shows it may sit down when the seat is free.
    """

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(16)
        self._key: str | None = None
        self._lock = threading.Lock()

    @property
    def taken(self) -> bool:
        """Whether there is an operator."""
        return self._key is not None

    def enter(self, token: str | None) -> Grant:
        """Somebody comes, with a token or None to watch."""
        if token is None:
            return Grant(None)
        if not self.shows(token):
            return Grant(None, "The token in the address is wrong: you can watch, not drive.")
        with self._lock:
            if self._key is not None:
                return Grant(
                    None,
                    "Somebody else is driving: you can watch. Reload the page when they have left.",
                )
            self._key = secrets.token_urlsafe(16)
            return Grant(self._key)

    def shows(self, token: str) -> bool:
        """Whether a token is the one."""
        return secrets.compare_digest(token.encode(), self.token.encode())

    def leave(self, key: str | None) -> None:
        """The holder of a key goes; the seat is free."""
        with self._lock:
            if self.holds(key):
                self._key = None

    def holds(self, key: str | None) -> bool:
        """Whether a key is the operator's."""
        current = self._key
        return (
            key is not None
            and current is not None
            and secrets.compare_digest(key.encode(), current.encode())
        )


def is_local(host: str | None) -> bool:
    """Whether a Host header names this machine, not a foreign name that resolves to it."""
    return host is not None and _hostname(f"//{host}") in _LOOPBACK


def is_same_origin(origin: str | None, host: str | None) -> bool:
    """Whether a page of this very server opens a connection, or no page at all.

    Args:
        origin: the Origin header; browsers always send it, programs need not.
        host: the Host header.
    """
    return origin is None or (is_local(host) and origin == f"http://{host}")


def _hostname(url: str) -> str | None:
    try:
        return urlsplit(url).hostname
    except ValueError:
        return None
