"""The way in, tried by clients that are no browser and know the protocol."""

import json
import os
import re
import socket
import time
from dataclasses import replace
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest

pytest.importorskip("websockets")

from operators import answer, beat, control, wait_for
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from poise.apps.live import _front as fronts
from poise.apps.live._front import PortInUseError
from poise.apps.live._loop import Pause
from poise.locomotion import DeviceStatus, Mode
from poise.locomotion._stepping import _guard as clocks

HELD = [None, {"position": [0.0, -0.13, 0.4]}]
"""The right handle, well above the ground [m]."""


def handles_rest(session):
    """The handles of the feet are on the feet."""
    now = session.loop.snapshot
    return np.abs(np.subtract(now.handles, now.soles)).max() < 0.02


@pytest.fixture(scope="module")
def session(run_session, tmp_path_factory):
    with run_session(tmp_path_factory.mktemp("takes")) as session:
        wait_for(lambda: session.loop.snapshot, "the first picture")
        yield session


@pytest.fixture
def front(session):
    """With nobody in the operator's seat, and a robot that stands there."""
    wait_for(lambda: not session.front.seat.taken, "an empty seat")
    wait_for(lambda: session.loop.snapshot.device is DeviceStatus.LOST, "the guard")
    return session.front


def get(front, path, **headers):
    """Status, text and headers of a page."""
    request = Request(f"http://127.0.0.1:{front.port}{path}", headers=headers)
    try:
        with urlopen(request, timeout=60) as response:
            return response.status, response.read().decode(), response.headers
    except HTTPError as error:
        with error:
            return error.code, error.read().decode(), error.headers


def test_the_page_needs_nothing_from_elsewhere_and_holds_no_token(still_front):
    status, page, headers = get(still_front, "/")
    assert status == 200
    assert "Make the robot step" in page
    assert still_front.seat.token not in page
    named = re.findall(r'(?:src|href)="([^"]+)"', page)
    assert {"page.css", "page.js", "scene.js", "three.bundle.min.js"} <= set(named)
    for name in named:
        assert name == "data:," or get(still_front, f"/{name}")[0] == 200
    # Nobody can embed it or load anything into it; the last two have no default.
    assert headers["Referrer-Policy"] == "no-referrer"
    for rule in ("default-src 'self'", "frame-ancestors 'none'", "base-uri 'none'", "form-action"):
        assert rule in headers["Content-Security-Policy"]


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/nothing", {}, 404),
        ("/scene", {}, 404),
        ("/takes/x", {}, 403),
        ("/takes/x?token=wrong", {}, 403),
        ("/takes/nothing?token={}", {}, 404),
        ("/", {"Host": "evil.example:8080"}, 403),
        ("/", {"Host": "127.0.0.1.evil.example"}, 403),
        ("/", {"Host": "["}, 403),
        # A foreign name that resolves to this machine.
        ("/", {"Host": "evil.example", "Origin": "http://evil.example"}, 403),
        ("/", {"Host": "localhost:8080", "Origin": "http://localhost:8080"}, 200),
        ("/", {"Host": "localhost:8080", "Origin": "https://localhost:8080"}, 403),
        ("/", {"Host": "127.0.0.1:8080", "Origin": "http://localhost:8080"}, 403),
        ("/", {"Origin": "http://evil.example"}, 403),
        ("/page.js", {"Origin": "null"}, 403),
        ("/shapes.json", {"Origin": "http://localhost:1"}, 403),
    ],
)
def test_there_is_nothing_else_and_nothing_for_pages_of_another_origin(
    still_front, path, headers, status
):
    assert get(still_front, path.format(still_front.seat.token), **headers)[0] == status


def test_recordings_are_for_who_has_the_token(still_front, desk, tmp_path):
    (tmp_path / "take-001.mcap").write_text("a take")
    desk.file = lambda name: tmp_path / name
    assert get(still_front, "/takes/take-001.mcap")[0] == 403
    token = f"?token={still_front.seat.token}"
    assert get(still_front, f"/takes/take-001.mcap{token}")[:2] == (200, "a take")


@pytest.mark.parametrize(
    "lines", ["GET //[ HTTP/1.1\r\n", "GET / HTTP/1.1\r\nOrigin: a\r\nOrigin: b\r\n"]
)
def test_what_no_browser_asks_is_refused_without_a_traceback(still_front, lines, capfd, caplog):
    with socket.create_connection(("127.0.0.1", still_front.port), timeout=60) as caller:
        caller.sendall(f"{lines}Host: 127.0.0.1:{still_front.port}\r\n\r\n".encode())
        assert b" 400 " in caller.recv(4096).split(b"\r\n")[0]
    assert "Traceback" not in capfd.readouterr().err + caplog.text


@pytest.mark.parametrize(
    ("path", "origin"),
    [("/control?token={}", "http://evil.example"), ("/", None), ("/scene", None)],
)
def test_there_is_no_other_channel_and_none_for_another_origin(still_front, path, origin):
    address = f"ws://127.0.0.1:{still_front.port}{path.format(still_front.seat.token)}"
    with pytest.raises(InvalidStatus):
        connect(address, proxy=None, origin=origin).close()
    assert not still_front.seat.taken


@pytest.mark.parametrize("token", [None, "wrong", "%C3%A9", "the token"])
def test_who_has_no_seat_sees_but_cannot_command_and_does_not_inherit_it(still_front, desk, token):
    token = still_front.seat.token if token == "the token" else token
    with control(still_front, still_front.seat.token) as (operator, hello):
        assert hello["hello"] == "operator"
        beat(operator)
        wait_for(lambda: len(desk.orders) == 1, "what the operator says")
        with control(still_front, token) as (watcher, hello):
            assert hello["hello"] == "watcher"
            own = token == still_front.seat.token
            words = "Somebody else is driving" if own else "wrong" if token else ""
            assert words in hello["reason"]
            assert json.loads(watcher.recv(timeout=60))["mode"] == "D"
            orders = {"do": "drive", "feet": HELD}, {"do": "pause", "value": True}, {"do": "reset"}
            for order in orders:
                watcher.send(json.dumps(order))
                assert "watching" in answer(watcher)["error"]
            operator.close()
            wait_for(lambda: not still_front.seat.taken, "an empty seat")
            beat(watcher)
            assert "watching" in answer(watcher)["error"]
            assert len(desk.orders) == 1
    with control(still_front, still_front.seat.token) as (_, hello):
        assert hello["hello"] == "operator"


def test_messages_beyond_all_measure_end_the_connection(still_front):
    with control(still_front, still_front.seat.token) as (operator, _):
        operator.send("x" * 100_000)
        with pytest.raises(ConnectionClosed):
            answer(operator)


def test_a_page_that_does_not_keep_up_holds_up_nobody(still_front, desk):
    # More than all buffers on the way hold.
    desk.told = desk.told | {"bodies": [0.25] * 30_000}
    address = f"ws://127.0.0.1:{still_front.port}/control"
    # It does not even say goodbye, which nobody is to wait for.
    late = connect(address, proxy=None, max_queue=1, close_timeout=0.1)
    with late, control(still_front) as (watcher, _):
        begin = time.monotonic()
        for _ in range(60):
            watcher.recv(timeout=60)
        # Of four seconds of statuses none has waited for the other one.
        assert time.monotonic() - begin < 30.0


def test_nothing_listens_but_the_front(still_front):
    """Nobody gets past it to a drawing behind it, or from another machine."""
    tables = [Path(f"/proc/self/net/{kind}") for kind in ("tcp", "tcp6")]
    if not tables[0].exists():
        pytest.skip("no list of sockets on this system")
    own = {os.readlink(link) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()}
    rows = [row.split() for table in tables for row in table.read_text().splitlines()[1:]]
    listening = [row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in own]
    assert f"0100007F:{still_front.port:04X}" in listening
    assert all(address.startswith("0100007F:") for address in listening)


# With a robot behind it ------------------------------------------------------------------------


def test_a_port_in_use_is_said(run_session, still_front, tmp_path):
    with (
        pytest.raises(PortInUseError, match=f"port {still_front.port}"),
        run_session(tmp_path, port=still_front.port),
    ):
        pass


def test_who_has_the_token_drives_and_is_answered_with_what_the_feet_feel(front, session):
    with control(front, front.seat.token) as (operator, hello):
        assert hello["hello"] == "operator"
        beat(operator)
        left, right = answer(operator)["forces"]
        weight = 9.81 * session.loop.lead.robot.mass
        assert left[2] + right[2] == pytest.approx(weight, rel=0.1)
        assert np.abs([*left[:2], *right[:2]]).max() < 0.2 * weight
        wait_for(session.takes.path.exists, "the recording")
        assert session.file(session.takes.path.name) == session.takes.path
        assert session.file("../../etc/passwd") is None
        for slow, speed in ((True, 0.25), (False, 1.0)):
            operator.send(json.dumps({"do": "slow", "value": slow}))
            wait_for(lambda speed=speed: session.loop.snapshot.speed == speed, "the speed")


def test_who_sends_what_does_not_count_is_told_why(front, monkeypatch):
    monkeypatch.setattr(clocks, "LOST_AFTER", 60.0)
    with control(front, front.seat.token) as (operator, _):
        for sent, told in (
            (2.0, {}),
            (1.99, {"old": 0.01}),
            (1.0, {"old": 1.0}),
            (9.0, {"early": 7.0}),
        ):
            operator.send(json.dumps({"do": "drive", "time": sent}))
            found = answer(operator)
            assert found.pop("echo") == sent
            assert found.pop("forces") is not None
            assert found == pytest.approx(told, abs=1.0 if "early" in told else 1e-9)


def test_whoever_comes_takes_the_seat_of_a_frozen_operator(front, session, monkeypatch):
    monkeypatch.setattr(fronts, "SILENT_FOR", 0.5)
    with control(front, front.seat.token) as (frozen, _):
        place = {"position": [0.0, float(session.loop.snapshot.soles[1][1]), 0.14]}
        beat(frozen)
        wait_for(
            lambda: beat(frozen, feet=[None, place]) or session.loop.snapshot.mode is Mode.SL,
            "the lift",
        )
        wait_for(lambda: not front.seat.taken, "the silence")
        with control(front, front.seat.token) as (second, hello):
            assert hello["hello"] == "operator"
            wait_for(lambda: session.loop.snapshot.mode is Mode.D, "the foot to come down")
            beat(second)
            # It wakes up: too late.
            beat(frozen, feet=[None, place])
            while "echo" in (told := answer(frozen)):
                pass
            assert told["hello"] == "watcher"
            assert "somebody else drives" in told["reason"]
            assert "watching" in answer(frozen)["error"]
            assert front.seat.taken
            assert handles_rest(session)


def test_pushes_do_not_pile_up_and_copies_are_kept_once_a_second(front, session):
    loop = session.loop
    given, push = [], loop.plant.push
    loop.plant.push = lambda *arguments: given.append(loop.plant.time) or push(*arguments)
    with control(front, front.seat.token) as (operator, _):
        # A recording begins with the first sample.
        wait_for(lambda: beat(operator) or session.takes.path.exists(), "the recording")
        for _ in range(500):
            operator.send('{"do": "push", "value": "forward"}')
            operator.send('{"do": "keep"}')
        operator.send('{"do": "drive"}')
        answers = []
        while (said := answer(operator)).get("echo") != 0.0:
            answers.append(said)
        wait_for(lambda: given, "a push")
        assert np.diff(given, append=np.inf).min() > 0.3 - 1e-9
        assert any("second" in said.get("error", "") for said in answers)
        assert sum("kept" in said for said in answers) < 50
        del loop.plant.push
        session._last.clear()
        operator.send('{"do": "reset"}')
        wait_for(lambda: loop.snapshot.time < given[0], "the reset")


def test_a_copy_that_takes_long_silences_no_operator(front, session, monkeypatch):
    done = []

    def copy():
        wait_for(lambda: done, "an operator who is heard")
        return Path("kept-001.mcap")

    monkeypatch.setattr(session.takes, "keep", copy)
    session._last.clear()
    with control(front, front.seat.token) as (operator, _):
        operator.send('{"do": "keep"}')
        beat(operator)
        assert "echo" in answer(operator)
        done.append(True)
        assert answer(operator) == {"kept": "kept-001.mcap"}


def test_the_operators_handle_lifts_the_foot_and_a_page_that_goes_lets_go(front, session):
    with control(front, front.seat.token) as (operator, _):
        beat(operator)
        place = {"position": [0.0, float(session.loop.snapshot.soles[1][1]), 0.14]}
        wait_for(
            lambda: beat(operator, feet=[None, place]) or session.loop.snapshot.mode is Mode.SL,
            "the lift",
        )
    wait_for(lambda: session.loop.snapshot.mode is Mode.D, "the foot to come down")


def test_what_is_held_at_a_reset_leads_nothing_until_it_is_let_go(front, session, monkeypatch):
    monkeypatch.setattr(clocks, "LOST_AFTER", 60.0)
    with control(front, front.seat.token) as (operator, _):
        for held, again in ((False, None), (True, None), ("reset", True), (False, None)):
            if held == "reset":
                session._last.clear()
                operator.send('{"do": "reset"}')
            beat(operator, lift=[False, bool(held)])
            assert answer(operator).get("again") is again


@pytest.mark.parametrize(
    "text",
    [
        "no json",
        "null",
        '{"do": "drive", "lift": [true], "move": [0, 0]}',
        '{"do": "drive", "lift": [true, true], "move": [NaN, 0]}',
        '{"do": "drive", "lift": [true, true], "move": [1e9, 0]}',
        '{"do": "drive", "feet": [{"position": [0, 0, 1e999]}, null]}',
        '{"do": "drive", "feet": [{"position": [0, 0, 0], "clutch": 1}, null]}',
        '{"do": "drive", "feet": [null]}',
        '{"do": "drive", "head": {"orientation": [0, 0, 1], "clutch": true}}',
        '{"do": "drive", "hand": [null, null]}',
        '{"do": "push", "value": "up"}',
        '{"do": "pause", "value": 1}',
        '{"do": "fly"}',
        '{"lift": [true, true]}',
        "[" * 20000,
        b"\xff",
    ],
)
def test_nonsense_of_an_operator_gets_an_answer_and_moves_nothing(front, session, text):
    with control(front, front.seat.token) as (operator, _):
        operator.send(text)
        assert answer(operator)["error"]
        assert session.loop.running
        assert session.loop.snapshot.mode is Mode.D


AWAY = {"position": [0.0, 1e300, 0.0], "clutch": True}
FAST = {"position": [0.0] * 3, "clutch": True, "velocity": [0.0, -1e300, 0.0]}
NO_TURN = {"position": [0.0] * 3, "clutch": True, "orientation": [0.0, 0.0, 1e300, 1.0]}


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize(
    ("member", "value"),
    [
        ("hands", AWAY), ("feet", AWAY), ("head", {"orientation": [0, 0, 9, 1], "clutch": True}),
        ("feet", FAST), ("hands", NO_TURN), ("feet", NO_TURN),
    ],
)  # fmt: skip
def test_what_is_out_of_reach_does_not_cost_the_rest_of_its_message(front, session, member, value):
    opened = {**value, "clutch": False}
    with control(front, front.seat.token) as (operator, _):
        for one, handle in ((opened, None), (value, HELD[1])):
            sent = {"feet": [None, handle], member: one}
            if member != "head":
                sent[member] = [one, handle if member == "feet" else None]
            beat(operator, **sent)
            assert answer(operator).keys() == {"echo", "forces"}
        wait_for(
            lambda: beat(operator, **sent) or session.loop.snapshot.handles[1][2] > 0.02,
            "the handle",
        )
        assert session.loop.running
        assert np.isfinite(session.loop.snapshot.handles).all()


def test_what_is_drawn_is_where_the_simulator_has_it(run_session, get_robot, tmp_path):
    from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, terrain_blocks

    blocks = terrain_blocks("steps", get_robot("biped20"))
    with run_session(tmp_path, plant=replace(VELOCITY_TELEOP_PLANT, blocks=blocks)) as session:
        shapes = json.loads(get(session.front, "/shapes.json")[1])
        wait_for(lambda: session.loop.snapshot, "the first picture")
        session.loop.order(Pause(True))
        wait_for(lambda: session.loop.snapshot.paused, "the pause")
        with control(session.front) as (watcher, _):
            status = json.loads(watcher.recv(timeout=60))
        data = session.loop.plant.data
        shown = np.reshape(status["bodies"], (-1, 3))
        np.testing.assert_allclose(shown, data.xpos, atol=1e-3)
        turns = np.reshape(status["turns"], (-1, 4))
        np.testing.assert_allclose(np.abs(np.sum(turns * data.xquat, axis=1)), 1.0, atol=1e-3)
    still = [shape for shape in shapes["geometries"] if shape["body"] == 0]
    assert [shape["shape"] for shape in still] == ["box"] * len(blocks)
    for shape, block in zip(still, blocks, strict=True):
        assert shape["position"] == pytest.approx([*block.center, 0.5 * block.size[2]])
        assert shape["size"] == pytest.approx([0.5 * side for side in block.size])
