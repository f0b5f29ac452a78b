"""`Seat`: who may command the robot. One operator at most, and only with the token."""

import secrets
import threading
import time as clock
from dataclasses import dataclass
from urllib.parse import urlsplit

SILENT_FOR = 5.0
"""An operator of whom nothing has been heard for so long [s] keeps nobody from the seat."""

_NO_TOKEN = (
    "The token in the address is wrong, or of an earlier run: you can watch, not drive. The "
    "address for driving was printed when this run began."
)

_LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True, eq=False)
class Grant:
    """What somebody who came may do; each is one connection's, and no other equals it.

    Attributes:
        drives: whether it came with the operator's seat.
        reason: why somebody with a token only watches.
    """

    drives: bool
    reason: str = ""


class Seat:
    """The operator's seat: for one at a time, who has it until they leave.

    A page may freeze without leaving. Who is silent loses the seat when somebody else with the
    token comes, and only then: a page that wakes up alone goes on.

    Attributes:
        token: whoever shows it may sit down when the seat is free.
    """

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(16)
        self._holder: Grant | None = None
        self._heard_at = 0.0
        self._lock = threading.Lock()

    @property
    def taken(self) -> bool:
        """Whether there is an operator, of whom something has been heard lately."""
        return self._holder is not None and clock.monotonic() - self._heard_at <= SILENT_FOR

    def enter(self, token: str | None) -> Grant:
        """Somebody comes, with a token or None to watch."""
        if token is None:
            return Grant(False)
        if not self.shows(token):
            return Grant(False, _NO_TOKEN)
        with self._lock:
            if self.taken:
                return Grant(
                    False,
                    "Somebody else is driving: you can watch. Reload the page when they have left.",
                )
            self._holder, self._heard_at = Grant(True), clock.monotonic()
            return self._holder

    def hears(self, grant: Grant) -> bool:
        """Takes a sign of life of somebody; whether they are the operator."""
        with self._lock:
            holds = self.holds(grant)
            if holds:
                self._heard_at = clock.monotonic()
            return holds

    def shows(self, token: str) -> bool:
        """Whether a token is the one."""
        return secrets.compare_digest(token.encode(), self.token.encode())

    def leave(self, grant: Grant) -> None:
        """Somebody goes; if it was the operator, the seat is free."""
        with self._lock:
            if self.holds(grant):
                self._holder = None

    def holds(self, grant: Grant) -> bool:
        """Whether a grant is the operator's."""
        return grant is self._holder


def is_local(host: str | None) -> bool:
    """Whether a Host header names this machine, not a foreign name that resolves to it."""
    return host is not None and _hostname(f"//{host}") in _LOOPBACK


def is_same_origin(origin: str | None, host: str | None) -> bool:
    """Accept connections of this server's own page, and those of no page."""
    return origin is None or (is_local(host) and origin == f"http://{host}")


def _hostname(url: str) -> str | None:
    try:
        return urlsplit(url).hostname
    except ValueError:
        return None
