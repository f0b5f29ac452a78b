"""Who may command."""

import pytest

pytest.importorskip("viser")

from poise.apps.live._seat import Seat, is_local, is_same_origin


def test_the_seat_is_for_one_with_the_token():
    seat = Seat()
    first = seat.enter(seat.token)
    assert seat.holds(first.key)
    second = seat.enter(seat.token)
    assert second.key is None
    assert "Somebody else" in second.reason
    seat.leave(second.key)
    assert seat.taken
    seat.leave(first.key)
    assert not seat.holds(first.key)
    assert seat.holds(seat.enter(seat.token).key)


@pytest.mark.parametrize("token", ["", "wrong", "é"])
def test_a_wrong_token_watches_and_is_told_so(token):
    seat = Seat()
    grant = seat.enter(token)
    assert grant.key is None
    assert "wrong" in grant.reason
    assert not seat.taken


def test_without_a_token_one_watches():
    grant = Seat().enter(None)
    assert (grant.key, grant.reason) == (None, "")


def test_no_key_holds_an_empty_seat():
    assert not Seat().holds(None)
    assert not Seat().holds("")


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
