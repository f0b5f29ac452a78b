"""`Seat`: the lease of the operator, for one connection at a time, and only with the token."""

import secrets
import time as clock
from dataclasses import dataclass
from urllib.parse import urlsplit

SILENT_FOR = 5.0  # silence after which an operator keeps nobody else from the seat [s]
_NO_TOKEN = (
    "The token in the address is wrong, or of an earlier run: you can watch, not drive. The "
    "address for driving was printed when this run began."
)
_TAKEN = "Somebody else is driving: you can watch. Reload the page when they have left."
_LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True, eq=False)
class Grant:
    """Rights of one connection; no other equals it."""

    drives: bool  # it came with the operator's seat
    reason: str = ""  # why one with a token only watches


class Seat:
    """Lease of the operator until its connection ends.

    A page may freeze without leaving. A silent operator loses the seat when another one with the
    token comes, and only then: a page that wakes up alone goes on.
    """

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


def is_local(host: str | None) -> bool:
    """Return whether a Host header names this machine, not a foreign name that resolves to it."""
    try:
        return host is not None and urlsplit(f"//{host}").hostname in _LOOPBACK
    except ValueError:
        return False


def is_same_origin(origin: str | None, host: str | None) -> bool:
    """Accept connections of this server's own page, and those of no page."""
    return origin is None or (is_local(host) and origin == f"http://{host}")
