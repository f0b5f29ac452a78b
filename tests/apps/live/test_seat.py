"""Who may command."""

import pytest

pytest.importorskip("websockets")

from poise.apps.live import _seat as seats
from poise.apps.live._seat import Seat, is_local, is_same_origin


def test_who_is_silent_keeps_nobody_from_the_seat_and_loses_it_only_to_somebody(monkeypatch):
    now = 100.0
    monkeypatch.setattr(seats.clock, "monotonic", lambda: now)
    seat = Seat()
    first = seat.enter(seat.token)
    now += seats.SILENT_FOR - 0.1
    assert not seat.enter(seat.token).drives
    assert seat.hears(first)
    now += seats.SILENT_FOR + 0.1
    assert not seat.taken
    # Nobody came: a page that wakes up goes on.
    assert seat.hears(first)
    assert seat.taken
    now += seats.SILENT_FOR + 0.1
    second = seat.enter(seat.token)
    assert second.drives
    assert not seat.hears(first)
    seat.leave(first)
    assert seat.hears(second)


@pytest.mark.parametrize(
    ("origin", "host", "same"),
    [
        (None, "127.0.0.1:8080", True),
        ("http://127.0.0.1:8080", "127.0.0.1:8080", True),
        ("http://localhost:8080", "localhost:8080", True),
        ("http://localhost:3000", "localhost:8080", False),
        ("http://localhost:8080", "127.0.0.1:8080", False),
        ("https://127.0.0.1:8080", "127.0.0.1:8080", False),
        ("http://evil.example", "127.0.0.1:8080", False),
        # A name of somebody else's that resolves to this machine.
        ("http://evil.example:8080", "evil.example:8080", False),
        ("null", "127.0.0.1:8080", False),
    ],
)
def test_only_pages_of_this_server_may_open_a_connection(origin, host, same):
    assert is_same_origin(origin, host) is same


@pytest.mark.parametrize("host", [None, "", "evil.example:8080", "127.0.0.1.evil.example", "["])
def test_foreign_hosts_are_not_local(host):
    assert not is_local(host)
